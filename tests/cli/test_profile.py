"""`modt-profile` from the outside."""

import json

import pytest

from modt import profile as profiles
from modt_commands import profile
from modt_simulation.synthetic_stream import SyntheticStream
from tests import recorded

from .commands import content, here, refusal, succeeded

pytestmark = pytest.mark.command


def test_meters_are_listed_with_reasons(capsys):
    assert here("meters", "--json", program=profile.main) == 0
    meters = json.loads(capsys.readouterr().out)["meters"]
    assert [m["used"] for m in meters] == [True] + [False] * (len(meters) - 1)
    for m in meters:
        assert m["usable"] or (m["why_not"] and m["remedy"])
    assert here("meters", program=profile.main) == 0
    assert meters[0]["name"] in capsys.readouterr().out


@pytest.fixture(scope="module")
def scans(tmp_path_factory):
    """Options of a recording of a small sensor."""
    stream = SyntheticStream("street", "vlp-16", 0.8, 0)
    return recorded.scans(tmp_path_factory.mktemp("scans"), stream), "--profile", "vlp-16"


@pytest.fixture(scope="module")
def compared(scans, tmp_path_factory):
    """Folder in which the modes were compared: other.json and page.html."""
    folder = tmp_path_factory.mktemp("compared")
    options = (*scans, "--repeat", 1, "--json", "--html", "page.html")
    done = succeeded("compare", *options, cwd=folder, module="modt_commands.profile")
    (folder / "other.json").write_text(done.stdout)
    return folder


def test_compare_runs_every_mode(compared):
    tree = content(compared / "other.json")
    assert set(tree["modes"]) == {"conventional", "efficient", "accurate"}
    assert tree["modes"]["conventional"]["beta"]["value"] == 1.0
    for saving in tree["savings"].values():
        changes = sum(t["change"]["value"] for t in saving["terms"])
        assert saving["gamma_short"]["value"] + changes == pytest.approx(saving["gamma_measured_cpu"]["value"])
    assert "<svg" in (compared / "page.html").read_text()


def test_a_prediction_is_compared_with_what_is_measured(scans, compared, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    other = (compared / "other.json").read_text()
    (tmp_path / "other.json").write_text(other)
    assert "other.json" in refusal(capsys, "predict", *scans, "--calibration", "other.json", program=profile.main)
    (tmp_path / "other.json").write_text(json.dumps(json.loads(other) | {"stream": "elsewhere"}))
    arguments = (*scans, "--frames", "4:8", "--calibration", "other.json", "--observe", "all", "--out", "blind.json")
    assert here("predict", *arguments, program=profile.main) == 0
    assert "efficient: gamma predicted" in capsys.readouterr().out
    blind = content(tmp_path / "blind.json")
    assert (blind["seen"], blind["calibration"]) == (4, ["elsewhere"])
    arguments = (*scans, "--frames", "4:8", "--repeat", 1, "--against", "blind.json")
    assert here("compare", *arguments, program=profile.main) == 0
    assert "gamma, accurate: predicted" in capsys.readouterr().out
    assert "asked" in refusal(
        capsys, "compare", *scans, "--frames", "0:4", "--against", "blind.json", program=profile.main
    )


def test_calibration_writes_a_profile_that_loads(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    short = ("--frames", "0:3", "--windows", 12, "--window-s", 0.12, "--burst-s", 0.02)
    assert here("calibrate", "--board", "bench", "--meter", "model", *short, program=profile.main) == 0
    assert "says nothing of the board" in capsys.readouterr().out
    energy = profiles.load(str(tmp_path / "board.yaml")).energy
    assert energy.board == "bench"
    assert energy.seg_J is not None
    assert "estimated" in energy.meter


@pytest.mark.parametrize(
    ("arguments", "named"),
    [
        (("report", "nowhere"), "run.yaml"),
        (("compare", "nowhere"), "nowhere"),
        (("compare", "--meter", "wattmeter"), "wattmeter"),
        (("calibrate", "--window-s", "-1"), "from 0.01 to 600"),
    ],
)
def test_misuse_is_one_line_and_status_2(capsys, arguments, named):
    assert named in refusal(capsys, *arguments, program=profile.main)
