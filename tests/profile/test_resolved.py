"""Several profiles, and those that they extend."""

from dataclasses import replace

import pytest

from modt import profile
from modt.config import EnergyConfig
from modt.errors import MisuseError


@pytest.fixture
def write(tmp_path, monkeypatch):
    """Write profiles into the working directory."""
    monkeypatch.chdir(tmp_path)

    def written(**texts):
        for name, text in texts.items():
            (tmp_path / f"{name}.yaml").write_text(text)

    return written


def test_a_sensor_and_a_board_are_put_together():
    found = profile.load(["vlp-16", "raspberry-pi-5"])
    assert found == replace(profile.load("vlp-16"), energy=profile.load("raspberry-pi-5").energy)
    assert found.energy.board == "Raspberry Pi 5"


def test_later_profiles_win_key_by_key(write):
    write(a="sensor: {height_m: 1.0, min_range_m: 1.0}\n", b="sensor: {height_m: 2.0}\nenergy: {idle_W: 1.0}\n")
    for names, height_m in ((["a.yaml", "b.yaml"], 2.0), (["b.yaml", "a.yaml"], 1.0)):
        found = profile.load(names)
        assert (found.sensor.height_m, found.sensor.min_range_m, found.energy.idle_W) == (height_m, 1.0, 1.0)


def test_a_profile_is_based_on_those_that_it_extends(write):
    write(mine="extends: [vlp-16, raspberry-pi-5]\nsensor: {height_m: 0.45}\n")
    own, both = profile.load("mine.yaml"), profile.load(["vlp-16", "raspberry-pi-5"])
    assert own == replace(both, sensor=replace(both.sensor, height_m=0.45))
    assert profile.parse("extends: mine.yaml\n", "other.yaml") == own
    found = profile.resolve(["os1-32", "raspberry-pi-5"])
    assert (found.sensor, found.used("as found")) == ("os1-32", ("os1-64", "os1-32", "raspberry-pi-5"))
    write(a="extends: vlp-16\nsensor: {height_m: 2.0}\n", b="extends: vlp-16\n")  # a shared base undoes nothing
    assert profile.load(["a.yaml", "b.yaml"]).sensor.height_m == 2.0
    assert profile.load(["a.yaml", "vlp-16"]).sensor.height_m == profile.load("vlp-16").sensor.height_m


def test_a_file_that_is_extended_lies_beside_the_one_that_does(write, tmp_path):
    write(base="sensor: {height_m: 0.45}\n")
    (tmp_path / "robots").mkdir()
    (tmp_path / "robots" / "mine.yaml").write_text("extends: ../base.yaml\n")
    assert profile.load("robots/mine.yaml").sensor.height_m == 0.45


def test_a_board_alone_goes_with_the_default_sensor():
    found = profile.resolve("raspberry-pi-5")
    assert found.config == replace(profile.load(), energy=profile.load("raspberry-pi-5").energy)
    assert found.sensor is None
    assert found.used("as found") == ("as found", "raspberry-pi-5")
    assert found.over(profile.load("vlp-16")) == profile.load(["vlp-16", "raspberry-pi-5"])


@pytest.mark.parametrize(
    ("texts", "parts"),
    [
        ({"a": "# mine\nextends: a.yaml\n"}, ["a.yaml:2", "extends itself"]),
        ({"a": "extends: b.yaml\n", "b": "\nextends: [vlp-16, a.yaml]\n"}, ["b.yaml:2", "by way of a, b", "remove"]),
        ({"a": "sensor: {}\nextends: vlp-61\n"}, ["a.yaml:2", "vlp-61", "vlp-16"]),
        ({"a": "extends: gone.yaml\n"}, ["a.yaml:1", "gone.yaml", "no such file"]),
        ({"a": "extends: {vlp-16: 1}\n"}, ["a.yaml:1", "no name"]),
        ({"a": "extends: b.yaml\n", "b": "sensor:\n  heigth_m: 1\n"}, ["b.yaml:2", "'height_m'"]),
        ({"a": "extend: vlp-16\n"}, ["a.yaml:1", "'extends'"]),
        ({"a": "sensor: {height_m: 99}\n"}, ["a.yaml:1", "height_m", "out of range"]),
    ],
)
def test_an_error_is_one_line_that_names_the_place(write, texts, parts):
    write(**texts)
    with pytest.raises(MisuseError) as caught:
        profile.load(["a.yaml", "hdl-64e"])
    message = str(caught.value)
    assert "\n" not in message
    assert all(part in message for part in parts), message


def test_profiles_that_do_not_go_together_are_named(write):
    write(budget="scheduler: {energy_mJ_per_frame: 5}\n", board="energy: {idle_W: 9}\n")
    assert profile.load("budget.yaml").energy == EnergyConfig()
    with pytest.raises(MisuseError, match=r"budget\.yaml, board\.yaml: scheduler\.energy_mJ_per_frame"):
        profile.load(["budget.yaml", "board.yaml"])


def test_a_shown_profile_can_be_read_and_says_who_set_each_key():
    found = profile.resolve(["os1-32", "raspberry-pi-5"])
    shown = found.shown()
    assert profile.parse(shown) == found.config
    lines = {line.strip() for line in shown.splitlines()}
    assert "height_m: 1.0 # os1-64" in lines
    assert "elevation_step_deg: 1.45 # os1-32" in lines
    assert "period_s: 0.1 # default" in lines
    assert "from 0.7 m on" in shown, "people are in view"
    assert "min_range_m: 2.0 # hdl-64e" in profile.resolve("raspberry-pi-5").shown()
