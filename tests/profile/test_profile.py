"""Reading, checking and writing of profiles."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from modt import assets, profile
from modt.config import (
    EnergyConfig,
    ProfileConfig,
    SchedulerConfig,
    SegmentationConfig,
    ValueRangeError,
)
from modt.errors import MisuseError
from modt.segmentation.clustering import Clusterer


@pytest.mark.parametrize("path", sorted(assets.folder("profiles").glob("*.yaml")), ids=lambda p: p.stem)
def test_every_profile_that_comes_along_loads(path):
    assert isinstance(profile.load(path.stem), ProfileConfig)
    assert profile.load(str(path)) == profile.load(path.stem)


def test_dump_and_parse_are_inverse():
    config = profile.parse(
        "fusion: {object_threshold: 0.9, point_change: [0.1, 0.2, 0.3, 0.4]}\nsensor: {height_m: null}\n"
    )
    assert config.fusion.point_change == (0.1, 0.2, 0.3, 0.4)
    assert config.sensor.height_m is None
    assert profile.parse(profile.to_yaml(profile.dump(config))) == config


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
def test_what_is_wrong_is_named_with_its_line(text, parts):
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


def test_a_profile_that_is_not_there_lists_those_that_are():
    with pytest.raises(MisuseError, match="hdl-64e"):
        profile.load("no-such-sensor")
    with pytest.raises(MisuseError, match="no such file"):
        profile.load("there/is/none.yaml")


def test_an_unreadable_profile_is_one_clear_error(tmp_path):
    path = tmp_path / "binary.yaml"
    path.write_bytes(b"\xff\xfe\x00\xd8")
    with pytest.raises(MisuseError, match="cannot be read"):
        profile.load(str(path))


def test_configuration_made_in_code_is_checked_too():
    with pytest.raises(ValueRangeError, match="cell_m"):
        SegmentationConfig(cell_m=-1.0)


@pytest.mark.parametrize(("cell_m", "range_m"), [(0.01, 400.0), (0.02, 400.0), (0.01, 80.0)])
def test_cells_that_take_all_memory_are_refused(cell_m, range_m):
    with pytest.raises(MisuseError, match=r"segmentation\.cell_m: .* million cells .* give at least 0\.0\d+ m"):
        profile.parse(f"sensor: {{max_range_m: {range_m}}}\nsegmentation: {{cell_m: {cell_m}}}")


@pytest.mark.parametrize(("cell_m", "range_m"), [(0.05, 400.0), (0.02, 80.0), (0.01, 20.0)])
def test_the_grids_of_a_valid_profile_take_little_memory(cell_m, range_m):
    config = profile.parse(f"sensor: {{max_range_m: {range_m}}}\nsegmentation: {{cell_m: {cell_m}}}")
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
