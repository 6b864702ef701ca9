"""`modt profile show` and `schema`, and several profiles, from the outside."""

import json

import pytest
import yaml

from modt import profile
from modt_desk.cli.profile_schema import schema_text
from modt_desk.simulation.synthetic_stream import SyntheticStream

from .commands import modt

pytestmark = pytest.mark.command


def test_what_is_shown_can_be_used(tmp_path):
    done = modt("profile", "show", "vlp-16", "raspberry-pi-5", cwd=tmp_path)
    assert (done.returncode, done.stderr) == (0, "")
    (tmp_path / "both.yaml").write_text(done.stdout)
    assert profile.load(tmp_path / "both.yaml") == profile.load(["vlp-16", "raspberry-pi-5"])
    assert modt("profile", "show", "vlp-61", cwd=tmp_path).returncode == 2


def test_the_schema_is_printed(tmp_path):
    assert modt("profile", "schema", cwd=tmp_path).stdout == schema_text()


def test_a_board_is_kept_where_the_sensor_is_recognised(tmp_path):
    (tmp_path / "scans").mkdir()
    for frame in SyntheticStream("street", "vlp-16", 0.2, seed=0):
        frame.points.tofile(tmp_path / "scans" / f"{frame.index:06d}.bin")
    done = modt("replay", "scans", "--quiet", "--profile", "raspberry-pi-5", "--out", "run", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    facts = yaml.safe_load((tmp_path / "run" / "run.yaml").read_text())
    assert facts["profiles"] == ["as found", "raspberry-pi-5"]
    assert facts["profile"]["energy"]["board"] == "Raspberry Pi 5"
    assert facts["profile"]["sensor"]["elevation_step_deg"] == pytest.approx(2.0, rel=0.02)


def test_a_run_names_its_profiles(tmp_path):
    chosen = ("--profile", "hdl-64e", "--profile", "raspberry-pi-5")
    for options, names in ((chosen, ["hdl-64e", "raspberry-pi-5"]), (chosen[2:], ["hdl-64e", "raspberry-pi-5"])):
        done = modt("replay", "--frames", "0:2", "--quiet", "--out", "run", *options, cwd=tmp_path)
        assert (done.returncode, done.stderr) == (0, "")
        facts = yaml.safe_load((tmp_path / "run" / "run.yaml").read_text())
        assert facts["profiles"] == names
        assert facts["recognition"]["used"] == "hdl-64e"
        assert facts["profile"] == profile.dump(profile.load(names))
        assert json.loads((tmp_path / "run" / "summary.json").read_text())["run"]["profile"] == " + ".join(names)
