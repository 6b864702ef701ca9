"""`modt-profile` from the outside."""

import json
import re

import pytest

from modt import profile as profiles

from .commands import modt

pytestmark = pytest.mark.command

MODULE = "modt.cli.profile"


def modt_profile(*arguments, cwd):
    return modt(*arguments, cwd=cwd, module=MODULE)


def test_meters_are_listed_with_reasons(tmp_path):
    done = modt_profile("meters", "--json", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    meters = json.loads(done.stdout)["meters"]
    assert sum(m["used"] for m in meters) == 1
    assert meters[0]["used"]
    for m in meters:
        assert m["usable"] or (m["why_not"] and m["remedy"])
    assert meters[0]["name"] in modt_profile("meters", cwd=tmp_path).stdout


def test_report_of_a_replay(tmp_path):
    assert modt("replay", "--mode", "efficient", "--frames", "0:5", "--out", "run", cwd=tmp_path).returncode == 0
    done = modt_profile("report", "run", "--html", "page.html", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert "energy of the pipeline a frame" in done.stdout
    assert "N_go" in done.stdout
    assert (tmp_path / "page.html").read_text().startswith("<!doctype html>")
    tree = json.loads(modt_profile("report", "run", "--json", cwd=tmp_path).stdout)
    assert tree["frames"] == 5
    assert tree["gross_J"]["value"] > 0


@pytest.fixture(scope="module")
def compared(tmp_path_factory):
    """Folder in which the modes were compared: other.json and page.html."""
    folder = tmp_path_factory.mktemp("compared")
    done = modt_profile("compare", "--frames", "0:8", "--repeat", 1, "--json", "--html", "page.html", cwd=folder)
    assert done.returncode == 0, done.stderr
    (folder / "other.json").write_text(done.stdout)
    return folder


def test_compare_runs_every_mode(compared):
    tree = json.loads((compared / "other.json").read_text())
    assert set(tree["modes"]) == {"conventional", "efficient", "accurate"}
    assert tree["modes"]["conventional"]["beta"]["value"] == 1.0
    for saving in tree["savings"].values():
        changes = sum(t["change"]["value"] for t in saving["terms"])
        assert saving["gamma_short"]["value"] + changes == pytest.approx(saving["gamma_measured_cpu"]["value"])
    page = (compared / "page.html").read_text()
    assert len(re.findall("<svg", page)) == 8


def test_a_prediction_is_compared_with_what_is_measured(compared, tmp_path):
    other = (compared / "other.json").read_text()
    (tmp_path / "other.json").write_text(other)
    itself = modt_profile("predict", "--calibration", "other.json", cwd=tmp_path)
    assert itself.returncode == 2
    assert "of another stream" in itself.stderr
    calibration = json.loads(other) | {"stream": "elsewhere"}
    (tmp_path / "other.json").write_text(json.dumps(calibration))
    arguments = ("--frames", "6:12", "--calibration", "other.json", "--observe", "all", "--out", "blind.json")
    done = modt_profile("predict", *arguments, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert "efficient: gamma predicted" in done.stdout
    blind = json.loads((tmp_path / "blind.json").read_text())
    assert (blind["seen"], blind["calibration"]) == (6, ["elsewhere"])
    done = modt_profile("compare", "--frames", "6:12", "--repeat", 1, "--against", "blind.json", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    for name in ("predicted", "gamma = N_go", "Equation 3 bare", "the calibration's ratio"):
        assert f"gamma, accurate: {name}" in done.stdout
    done = modt_profile("compare", "--frames", "0:6", "--against", "blind.json", cwd=tmp_path)
    assert done.returncode == 2
    assert "asked" in done.stderr


def test_calibration_writes_a_profile_that_loads(tmp_path):
    short = ("--frames", "0:3", "--windows", 12, "--window-s", 0.12, "--burst-s", 0.02)
    done = modt_profile("calibrate", "--board", "bench", "--meter", "model", *short, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert "says nothing of the board" in done.stdout
    energy = profiles.load(str(tmp_path / "board.yaml")).energy
    assert energy.board == "bench"
    assert energy.seg_J is not None
    assert "estimated" in energy.meter


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("report", "nowhere"), "run.yaml"),
        (("compare", "nowhere"), "nowhere"),
        (("compare", "--meter", "wattmeter"), "wattmeter"),
        (("calibrate", "--window-s", "-1"), "from 0.01 to 600"),
    ],
)
def test_misuse_is_one_line_and_status_2(tmp_path, arguments, said):
    done = modt_profile(*arguments, cwd=tmp_path)
    assert done.returncode == 2
    assert said in done.stderr
    assert "Traceback" not in done.stderr
