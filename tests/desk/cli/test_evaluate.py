"""`modt evaluate` from the outside."""

import json
import shutil

import pytest

from tests.cli.commands import here, modt, refusal
from tests.desk.recorded import drive_and_run
from tests.viewer.chromium import LOADED, WIDE

pytestmark = pytest.mark.command

COLUMNS = "frame,object,type,x,y,z_bottom,length,width,height,yaw"


@pytest.fixture(scope="module")
def drives(tmp_path_factory):
    """Two synthetic drives and the runs on them, by sensor."""
    root = tmp_path_factory.mktemp("drives")
    return {sensor: drive_and_run(root, sensor) for sensor in ("vlp-16", "hdl-32e")}


def test_the_page_has_the_figures_and_their_plots(drives, tmp_path, chromium):
    done = modt("evaluate", *drives["vlp-16"], "--html", "page.html", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    with chromium.tab((tmp_path / "page.html").as_uri(), width=390, ready=LOADED) as tab:
        assert not tab.value(WIDE)
        assert done.stdout.strip() in tab.value("document.querySelector('pre').textContent")
        titles = tab.value("[...document.querySelectorAll('.plots h2')].map((title) => title.textContent)")
        assert len([title for title in titles if "by range" in title]) == 2
        assert tab.value("document.querySelectorAll('polyline').length") >= 3


def evaluated(capsys, *arguments):
    """Text that the command prints."""
    capsys.readouterr()
    assert here("evaluate", *arguments) == 0
    return capsys.readouterr().out


def test_runs_are_pooled_by_sensor(drives, capsys):
    pairs = [path for pair in drives.values() for path in pair]
    found = json.loads(evaluated(capsys, *pairs, "--json"))
    assert found["schema"] == "modt.evaluation/1"
    one, other, both = (found["sensors"][name] for name in (*drives, "all sensors"))
    assert both["frames"] == one["frames"] + other["frames"] == 10
    objects = [e["ranges"]["all"]["segmentation"]["car"]["objects"] for e in (one, other, both)]
    assert objects[2] == objects[0] + objects[1] > 0
    assert both["tracks"]["all"]["life"]["frames"] > 0
    assert 0 < both["metrics"]["all"]["HOTA"] <= 1
    summary = json.loads((drives["vlp-16"][0] / "summary.json").read_text())
    assert one["beta"] == pytest.approx(summary["beta"], abs=1e-6)


def test_a_wider_sector_and_cut_objects_count_on_request(drives, capsys):
    called = []
    for options in ((), ("--sector", "180", "--count", "cut")):
        found = json.loads(evaluated(capsys, *drives["vlp-16"], "--json", *options))
        classes = found["sensors"]["vlp-16"]["ranges"]["all"]["classification"]
        called.append(sum(score["called"] for score in classes.values()))
    assert called[0] < called[1]


def test_misuse_is_one_line_with_the_remedy(drives, tmp_path, capsys):
    run, truth = drives["vlp-16"]
    lines = (run / "tracks.jsonl").read_text().splitlines(keepends=True)

    def copy(name, tracks=lines):
        shutil.copytree(run, tmp_path / name)
        (tmp_path / name / "tracks.jsonl").write_text("".join(tracks))
        return tmp_path / name

    bare, cut, empty = copy("bare"), copy("cut"), copy("empty", [])
    shutil.rmtree(bare / "labels")
    (cut / "labels" / "000003.label").unlink()
    odd = copy("odd", [lines[0], lines[1].replace('"proposals":', '"proposals_":', 1)])
    longer = copy("longer", [*lines, lines[-1].replace('"frame":4', '"frame":9')])
    broken = tmp_path / "broken.csv"
    broken.write_text(f"{COLUMNS}\n0,1,Tree,9,0,-1.7,1,1,2,0\n")
    for arguments, message in (
        ((bare, truth), "modt replay --labels"),
        ((cut, truth), "000003.label: cannot be read"),
        ((odd, truth), "tracks.jsonl:2: no record of a frame"),
        ((empty, truth), "no frames are recorded"),
        ((longer, truth), "frame 9 is not in the truth"),
        ((run, drives["hdl-32e"][1]), "labels for a scan of"),
        ((run,), "are no pairs"),
        ((tmp_path, truth), "describes no run"),
        ((run, truth, "--further", broken), "broken.csv:2: 'Tree' is no type of an object"),
        ((run, truth, run, truth, "--further", broken), "--further: is for one drive"),
        ((run, truth, "--json", "--unlabelled", "found"), "makes a list, and no evaluation"),
        ((run, truth, "--sector", "0"), "is no half sector"),
    ):
        assert message in refusal(capsys, "evaluate", *arguments)
