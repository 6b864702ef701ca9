"""Reading, checking and writing of profiles."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from modt import assets, profile
from modt.config import (
    EnergyConfig,
    ProfileConfig,
    SchedulerConfig,
)
from modt.errors import MisuseError
from modt.segmentation.clustering import Clusterer


@pytest.mark.parametrize("path", sorted(assets.folder("profiles").glob("*.yaml")), ids=lambda p: p.stem)
def test_every_profile_that_comes_along_loads(path):
    assert isinstance(profile.load(path.stem), ProfileConfig)
    assert profile.load(str(path)) == profile.load(path.stem)


@pytest.mark.parametrize(
    ("text", "parts"),
    [
        ("sensr: {}\n", ["p.yaml:1", "unknown key 'sensr'", "'sensor'"]),
        ("sensor:\n  height_m: 1.0\n  heigth: 2\n", ["p.yaml:3", "'heigth'", "'height_m'"]),
        ("segmentation:\n  min_points: 5\n  cell_m: 99\n", ["p.yaml:3", "cell_m", "out of range"]),
        ("segmentation:\n  min_points: 2.5\n", ["p.yaml:2", "min_points", "whole number"]),
        ("tracking:\n  association: magic\n", ["p.yaml:2", "'magic'", "paper"]),
        ("fusion:\n  point_change: [1, 2]\n", ["p.yaml:2", "point_change", "4 values"]),
        ("sensor:\n  elevations_deg: [1]\n", ["p.yaml:2", "elevations_deg", "2 to 512 values"]),
        ("sensor:\n  blind_sectors_deg: [1, 2, 3]\n", ["p.yaml:2", "blind_sectors_deg", "no pairs"]),
        ("fusion: 3\n", ["p.yaml:1", "no mapping"]),
        ("a: [1\n", ["p.yaml:", "no YAML"]),
        ("sensor: {}\nsensor: {}\n", ["p.yaml:2", "twice"]),
        (
            "scheduler: {energy_mJ_per_frame: 5}\nenergy: {idle_W: 3, busy_W: 3}\n",
            ["p.yaml: scheduler.energy_mJ_per_frame", "busy_W", "calibrate"],
        ),
    ],
)
def test_an_error_is_named_with_its_line(text, parts):
    with pytest.raises(MisuseError) as caught:
        profile.parse(text, "p.yaml")
    message = str(caught.value)
    assert "\n" not in message
    assert all(part in message for part in parts), message


@given(st.text(max_size=60))
def test_any_text_is_a_profile_or_one_clear_error(text):
    try:
        parsed = profile.parse(text)
    except MisuseError:
        return
    assert isinstance(parsed, ProfileConfig)


def test_a_profile_that_cannot_be_read_is_one_clear_error(tmp_path):
    (tmp_path / "binary.yaml").write_bytes(b"\xff\xfe\x00\xd8")
    absent = (("no-such-sensor", "hdl-64e"), ("there/is/none.yaml", "no such file"))
    for name, named in (*absent, (str(tmp_path / "binary.yaml"), "cannot be read")):
        with pytest.raises(MisuseError, match=named):
            profile.load(name)


@pytest.mark.parametrize(
    ("cell_m", "range_m", "valid"),
    [(0.01, 400.0, False), (0.02, 400.0, False), (0.01, 80.0, False), (0.05, 400.0, True), (0.01, 20.0, True)],
)
def test_cells_that_take_all_memory_are_refused_and_others_take_little(cell_m, range_m, valid):
    text = f"sensor: {{max_range_m: {range_m}}}\nsegmentation: {{cell_m: {cell_m}}}"
    if not valid:
        with pytest.raises(MisuseError, match=r"segmentation\.cell_m: .* give at least 0\.0\d+ m"):
            profile.parse(text)
        return
    config = profile.parse(text)
    clustering = Clusterer(config.sensor, config.segmentation)
    assert clustering.coarse.number.nbytes + clustering.fine.number.nbytes < 2.5e8


@pytest.mark.parametrize(
    ("time_ms", "energy_mJ", "allowed_ms"),
    [(None, None, None), (4.0, None, 4.0), (None, 6.0, 3.0), (4.0, 6.0, 3.0), (2.0, 6.0, 2.0), (None, 0.0, 0.0)],
)
def test_of_time_and_energy_the_scarcer_binds(time_ms, energy_mJ, allowed_ms):
    config = ProfileConfig(
        scheduler=SchedulerConfig(cpu_ms_per_frame=time_ms, energy_mJ_per_frame=energy_mJ),
        energy=EnergyConfig(idle_W=3.0, busy_W=5.0),
    )
    assert config.classification_ms == allowed_ms
