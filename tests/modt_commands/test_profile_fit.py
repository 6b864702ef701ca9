"""`modt profile fit`, and recognition of the sensor by `modt replay`, from the outside."""

import pytest

from modt import profile
from modt_simulation.synthetic_stream import SyntheticStream
from tests import recorded
from tests.cli.commands import content, here, refusal

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
    found = profile.load(str(tmp_path / "puck.yaml"))
    own = profile.load("vlp-16")
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


def test_a_sensor_that_is_asked_for_is_used_with_a_warning_where_it_does_not_fit(scans, tmp_path, caplog):
    assert here("replay", scans, "--quiet", "--profile", "hdl-64e", "--out", tmp_path / "run") == 0
    assert "used all the same" in caplog.text
    facts = content(tmp_path / "run/run.yaml")
    assert facts["recognition"]["used"] == "hdl-64e"
    assert facts["profile"] == profile.dump(profile.load("hdl-64e"))
