"""Reading, checking, combining and writing of profiles."""

from dataclasses import replace

import pytest

from modt import assets, profile
from modt.config import EnergyConfig, ProfileConfig, SchedulerConfig
from modt.errors import MisuseError
from modt.segmentation.cell_clusterer import CellClusterer
from modt_commands import profile_group


@pytest.fixture
def write(tmp_path, monkeypatch):
    """Write profiles into the working directory."""
    monkeypatch.chdir(tmp_path)

    def written(**texts):
        for name, text in texts.items():
            (tmp_path / f"{name}.yaml").write_text(text)

    return written


@pytest.mark.parametrize("path", sorted(assets.folder("profiles").glob("*.yaml")), ids=lambda p: p.stem)
def test_every_profile_that_comes_along_loads(path):
    assert isinstance(profile.load(path.stem), ProfileConfig)
    assert profile.load(str(path)) == profile.load(path.stem)


BUDGET = "scheduler: {energy_mJ_per_frame: 5}\n"


@pytest.mark.parametrize(
    ("texts", "parts"),
    [
        (["sensor:\n  height_m: 1.0\n  heigth: 2\n"], ["a.yaml:3", "'heigth'", "'height_m'"]),
        (["segmentation:\n  min_points: 5\n  cell_m: 99\n"], ["a.yaml:3", "cell_m", "out of range"]),
        (["segmentation:\n  min_points: 2.5\n"], ["a.yaml:2", "min_points", "whole number"]),
        (["tracking:\n  association: magic\n"], ["a.yaml:2", "'magic'", "paper"]),
        (["fusion:\n  point_change: [1, 2]\n"], ["a.yaml:2", "point_change", "4 values"]),
        (["sensor:\n  elevations_deg: [1]\n"], ["a.yaml:2", "elevations_deg", "2 to 512 values"]),
        (["sensor:\n  blind_sectors_deg: [1, 2, 3]\n"], ["a.yaml:2", "blind_sectors_deg", "no pairs"]),
        (["fusion: 3\n"], ["a.yaml:1", "no mapping"]),
        (["a: [1\n"], ["a.yaml:", "no YAML"]),
        (["sensor: {}\nsensor: {}\n"], ["a.yaml:2", "twice"]),
        ([f"{BUDGET}energy: {{busy_W: 3}}\n"], ["a.yaml: scheduler.energy_mJ_per_frame", "busy_W", "calibrate"]),
        ([BUDGET, "energy: {idle_W: 9}\n"], ["a.yaml, b.yaml: scheduler.energy_mJ_per_frame"]),
        (["# mine\nextends: a.yaml\n"], ["a.yaml:2", "extends itself"]),
        (["extends: b.yaml\n", "\nextends: [vlp-16, a.yaml]\n"], ["b.yaml:2", "by way of a, b", "remove"]),
        (["sensor: {}\nextends: vlp-61\n"], ["a.yaml:2", "vlp-61", "vlp-16"]),
        (["extends: gone.yaml\n"], ["a.yaml:1", "gone.yaml", "no such file"]),
        (["extends: {vlp-16: 1}\n"], ["a.yaml:1", "no name"]),
        (["extends: b.yaml\n", "sensor:\n  heigth_m: 1\n"], ["b.yaml:2", "'height_m'"]),
        (["extend: vlp-16\n"], ["a.yaml:1", "'extends'"]),
    ],
)
def test_an_error_is_one_line_that_names_the_place(write, texts, parts):
    names = ("a.yaml", "b.yaml")[: len(texts)]
    write(**dict(zip("ab", texts, strict=False)))
    with pytest.raises(MisuseError) as caught:
        profile.load(names)
    message = str(caught.value)
    assert "\n" not in message
    assert all(part in message for part in parts), message


def test_a_profile_that_cannot_be_read_is_one_clear_error(tmp_path):
    (tmp_path / "binary.yaml").write_bytes(b"\xff\xfe\x00\xd8")
    absent = (("no-such-sensor", "hdl-64e"), ("there/is/none.yaml", "no such file"))
    for name, named in (*absent, (str(tmp_path / "binary.yaml"), "cannot be read")):
        with pytest.raises(MisuseError, match=named):
            profile.load(name)


@pytest.mark.parametrize(
    ("cell_m", "range_m", "valid"),
    [(0.02, 400.0, False), (0.01, 80.0, False), (0.05, 400.0, True), (0.01, 20.0, True)],
)
def test_cells_that_take_all_memory_are_refused_and_others_take_little(cell_m, range_m, valid):
    text = f"sensor: {{max_range_m: {range_m}}}\nsegmentation: {{cell_m: {cell_m}}}"
    if not valid:
        with pytest.raises(MisuseError, match=r"segmentation\.cell_m: .* give at least 0\.0\d+ m"):
            profile.parse(text)
        return
    config = profile.parse(text)
    clusterer = CellClusterer(config.sensor, config.segmentation)
    assert clusterer.coarse.number.nbytes + clusterer.fine.number.nbytes < 2.5e8


@pytest.mark.parametrize(
    ("time_ms", "energy_mJ", "allowed_ms"),
    [(None, None, None), (4.0, None, 4.0), (None, 6.0, 3.0), (4.0, 6.0, 3.0), (2.0, 6.0, 2.0), (None, 0.0, 0.0)],
)
def test_of_time_and_energy_the_scarcer_binds(time_ms, energy_mJ, allowed_ms):
    scheduler = SchedulerConfig(cpu_ms_per_frame=time_ms, energy_mJ_per_frame=energy_mJ)
    config = ProfileConfig(scheduler=scheduler, energy=EnergyConfig(idle_W=3.0, busy_W=5.0))
    assert config.classification_ms == allowed_ms


def test_later_profiles_win_key_by_key(write):
    write(a="sensor: {height_m: 1.0, min_range_m: 1.0}\n", b="sensor: {height_m: 2.0}\nenergy: {idle_W: 1.0}\n")
    for names, height_m in ((["a.yaml", "b.yaml"], 2.0), (["b.yaml", "a.yaml"], 1.0)):
        found = profile.load(names)
        assert (found.sensor.height_m, found.sensor.min_range_m, found.energy.idle_W) == (height_m, 1.0, 1.0)


def test_a_profile_is_based_on_those_that_it_extends(write, tmp_path):
    write(mine="extends: [vlp-16, raspberry-pi-5]\nsensor: {height_m: 0.45}\n")
    own = profile.load("mine.yaml")
    both = profile.load(["vlp-16", "raspberry-pi-5"])
    assert own == replace(both, sensor=replace(both.sensor, height_m=0.45))
    assert profile.parse("extends: mine.yaml\n", "other.yaml") == own
    found = profile.resolve(["os1-32", "raspberry-pi-5"])
    assert (found.sensor, found.used("as found")) == ("os1-32", ("os1-64", "os1-32", "raspberry-pi-5"))
    write(a="extends: vlp-16\nsensor: {height_m: 2.0}\n", b="extends: vlp-16\n")  # a shared base undoes nothing
    assert profile.load(["a.yaml", "b.yaml"]).sensor.height_m == 2.0
    assert profile.load(["a.yaml", "vlp-16"]).sensor.height_m == profile.load("vlp-16").sensor.height_m
    (tmp_path / "robots").mkdir()
    (tmp_path / "robots" / "mine.yaml").write_text("extends: ../mine.yaml\n")  # beside the file that extends it
    assert profile.load("robots/mine.yaml") == own


def test_a_board_alone_goes_with_the_default_sensor():
    found = profile.resolve("raspberry-pi-5")
    sensor = profile.load("vlp-16")
    assert found.config == replace(profile.load(), energy=found.config.energy)
    assert found.config.energy.board == "Raspberry Pi 5"
    assert (found.sensor, found.used("as found")) == (None, ("as found", "raspberry-pi-5"))
    assert found.applied_to(sensor) == profile.load(["vlp-16", "raspberry-pi-5"])
    assert found.applied_to(sensor) == replace(sensor, energy=found.config.energy)


def test_a_shown_profile_can_be_read_and_says_who_set_each_key():
    found = profile.resolve(["os1-32", "raspberry-pi-5"])
    shown = profile_group.shown(found)
    assert profile.parse(shown) == found.config
    lines = {line.strip() for line in shown.splitlines()}
    assert "height_m: 1.0 # os1-64" in lines
    assert "elevation_step_deg: 1.45 # os1-32" in lines
    assert "period_s: 0.1 # default" in lines
    assert "from 1.1 m on" in shown, "people are in view"
    assert "min_range_m: 2.0 # hdl-64e" in profile_group.shown(profile.resolve("raspberry-pi-5"))


def test_a_mount_goes_with_any_sensor_and_with_one_that_is_recognised():
    found = profile.resolve(["mid-360", "small-robot"])
    livox = profile.load("mid-360").sensor
    assert found.sensor == "mid-360"
    assert found.config.sensor == replace(livox, height_m=0.3, min_range_m=0.2, max_range_m=30.0)
    assert profile.resolve("small-robot").sensor is None
