"""`modt profile show` and `schema`, and several profiles, from the outside."""

import pytest

from modt import profile
from modt_commands.profile_schema import schema_text

from .commands import content, here

pytestmark = pytest.mark.command


def test_a_profile_and_the_schema_are_printed(capsys):
    assert here("profile", "show", "vlp-16") == 0
    assert profile.parse(capsys.readouterr().out) == profile.load("vlp-16")
    assert here("profile", "schema") == 0
    assert capsys.readouterr().out == schema_text()


@pytest.mark.parametrize("chosen", [("hdl-64e", "raspberry-pi-5"), ("raspberry-pi-5",)])
def test_a_run_names_its_profiles(chosen, tmp_path):
    """A board goes with the sensor that is recognised."""
    options = (word for name in chosen for word in ("--profile", name))
    assert here("replay", "--frames", "0:2", "--quiet", "--out", tmp_path / "run", *options) == 0
    names = ["hdl-64e", "raspberry-pi-5"]
    facts = content(tmp_path / "run/run.yaml")
    assert facts["profiles"] == names
    assert facts["recognition"]["used"] == "hdl-64e"
    assert facts["profile"] == profile.dump(profile.load(names))
    assert content(tmp_path / "run/summary.json")["run"]["profile"] == " + ".join(names)
