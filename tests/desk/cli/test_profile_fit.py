"""`modt profile fit`, and recognition of the sensor by `modt replay`, from the outside."""

import pytest
import yaml

from modt import profile
from modt_desk.simulation.synthetic_stream import SyntheticStream
from tests.cli.commands import modt

pytestmark = pytest.mark.command


@pytest.fixture(scope="module", name="scans")
def scans_of_a_puck(tmp_path_factory):
    folder = tmp_path_factory.mktemp("puck") / "scans"
    folder.mkdir()
    for frame in SyntheticStream("street", "vlp-16", 1.0, seed=3):
        frame.points.tofile(folder / f"{frame.index:06d}.bin")
    return folder


def test_a_fitted_profile_is_that_of_the_sensor(scans, tmp_path):
    done = modt("profile", "fit", scans, "--name", "puck", "--sweeps", 5, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert "16 beams" in done.stdout
    assert "to be checked: sensor.period_s" in done.stdout
    found, own = profile.load(str(tmp_path / "puck.yaml")), profile.load("vlp-16")
    assert found.sensor.elevation_step_deg == pytest.approx(own.sensor.elevation_step_deg, rel=0.02)
    assert found.sensor.height_m == pytest.approx(own.sensor.height_m, abs=0.1)
    assert found.decision.frequency is not None
    assert 0 < sum(found.decision.frequency) < 0.8
    assert "to be checked: decision.frequency" in done.stdout  # of few proposals
    assert modt("replay", scans, "--profile", "puck.yaml", "--out", "run", cwd=tmp_path).stderr.count("\n") == 2


@pytest.mark.parametrize(
    ("arguments", "said"), [(("nowhere",), "no such file"), (("scans", "--sweeps", "0"), "from 1 to 1000")]
)
def test_misuse_is_one_line_and_status_2(tmp_path, arguments, said):
    done = modt("profile", "fit", *arguments, cwd=tmp_path)
    assert done.returncode == 2
    assert said in done.stderr
    assert "Traceback" not in done.stderr


def test_a_profile_is_not_overwritten(scans, tmp_path):
    (tmp_path / "own.yaml").write_text("sensor: {}\n")
    done = modt("profile", "fit", scans, "--out", "own.yaml", cwd=tmp_path)
    assert done.returncode == 2
    assert (tmp_path / "own.yaml").read_text() == "sensor: {}\n"


def test_another_sensor_than_the_default_is_recognised(scans, tmp_path):
    done = modt("replay", scans, "--quiet", "--out", "run", cwd=tmp_path)
    (line,) = done.stderr.splitlines()
    assert "used instead" in line
    assert "--profile vlp-16" in line
    facts = yaml.safe_load((tmp_path / "run" / "run.yaml").read_text())
    assert facts["recognition"]["nearest"] == "vlp-16"
    assert facts["recognition"]["used"] == "as found"
    assert facts["profile"]["sensor"]["elevation_step_deg"] == pytest.approx(2.0, rel=0.02)


def test_a_profile_that_was_asked_for_is_used_and_warned_of(scans, tmp_path):
    done = modt("replay", scans, "--quiet", "--profile", "hdl-64e", "--out", "run", cwd=tmp_path)
    (line,) = done.stderr.splitlines()
    assert "used all the same" in line
    facts = yaml.safe_load((tmp_path / "run" / "run.yaml").read_text())
    assert facts["profile"] == profile.dump(profile.load("hdl-64e"))


def test_a_profile_that_fits_is_not_mentioned(scans, tmp_path):
    assert modt("replay", scans, "--quiet", "--profile", "vlp-16", "--out", "run", cwd=tmp_path).stderr == ""
