"""`modt profile fit`, and recognition of the sensor by `modt replay`, from the outside."""

import pytest
import yaml

from modt import profile
from modt_desk.simulation.synthetic_stream import SyntheticStream
from tests.cli.commands import here, refusal
from tests.desk import recorded

pytestmark = pytest.mark.command


@pytest.fixture(scope="module", name="scans")
def scans_of_a_puck(tmp_path_factory):
    return recorded.scans(tmp_path_factory.mktemp("puck"), SyntheticStream("street", "vlp-16", 1.0, seed=3))


def test_a_fitted_profile_is_that_of_the_sensor_and_is_not_overwritten(scans, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert here("profile", "fit", scans, "--name", "puck", "--sweeps", 5) == 0
    said = capsys.readouterr().out
    assert "16 beams" in said
    assert "to be checked: sensor.period_s" in said
    assert "to be checked: decision.frequency" in said, "it rests on few proposals"
    found, own = profile.load(str(tmp_path / "puck.yaml")), profile.load("vlp-16")
    assert found.sensor.elevation_step_deg == pytest.approx(own.sensor.elevation_step_deg, rel=0.02)
    assert found.sensor.height_m == pytest.approx(own.sensor.height_m, abs=0.1)
    assert 0 < sum(found.decision.frequency) < 0.8
    before = (tmp_path / "puck.yaml").read_bytes()
    assert "puck.yaml" in refusal(capsys, "profile", "fit", scans, "--out", "puck.yaml")
    assert (tmp_path / "puck.yaml").read_bytes() == before


@pytest.mark.parametrize(
    ("arguments", "named"), [(("nowhere",), "no such file"), (("scans", "--sweeps", "0"), "from 1 to 1000")]
)
def test_misuse_is_one_line_and_status_2(capsys, arguments, named):
    assert named in refusal(capsys, "profile", "fit", *arguments)


@pytest.mark.parametrize(
    ("asked", "used", "warning"),
    [
        ((), "as found", "--profile vlp-16"),
        (("raspberry-pi-5",), "as found", "--profile vlp-16"),
        (("hdl-64e",), "hdl-64e", "used all the same"),
        (("vlp-16",), "vlp-16", ""),
    ],
    ids=["default", "a board", "another sensor", "the sensor"],
)
def test_another_sensor_than_the_profiles_is_recognised_and_used_unless_one_is_asked_for(
    scans, asked, used, warning, tmp_path, caplog
):
    options = (word for name in asked for word in ("--profile", name))
    assert here("replay", scans, "--quiet", *options, "--out", tmp_path / "run") == 0
    assert len(caplog.records) == bool(warning)
    assert warning in caplog.text
    facts = yaml.safe_load((tmp_path / "run" / "run.yaml").read_text())
    assert facts["recognition"]["used"] == used
    if used == "as found":
        assert facts["profile"]["sensor"]["elevation_step_deg"] == pytest.approx(2.0, rel=0.02)
        board = profile.load(list(asked)).energy.board if asked else profile.load().energy.board
        assert facts["profile"]["energy"]["board"] == board
    else:
        assert facts["profile"] == profile.dump(profile.load(used))
