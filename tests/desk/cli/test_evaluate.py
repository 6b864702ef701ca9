"""`modt evaluate` from the outside."""

import json
import shutil

import pytest

from tests.cli.commands import modt
from tests.desk.recorded import drive_and_run
from tests.viewer.chromium import LOADED, WIDE

pytestmark = pytest.mark.command

COLUMNS = "frame,object,type,x,y,z_bottom,length,width,height,yaw"


@pytest.fixture(scope="module")
def drives(tmp_path_factory):
    """Two synthetic drives and the runs on them, by sensor."""
    root = tmp_path_factory.mktemp("drives")
    return {sensor: drive_and_run(root, sensor) for sensor in ("vlp-16", "hdl-32e")}


def test_runs_are_pooled_by_sensor(drives, tmp_path):
    pairs = [path for pair in drives.values() for path in pair]
    done = modt("evaluate", *pairs, "--json", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout)
    assert found["schema"] == "modt.evaluation/1"
    assert set(found["sensors"]) == {*drives, "all sensors"}
    one, other, both = (found["sensors"][name] for name in (*drives, "all sensors"))
    assert both["frames"] == one["frames"] + other["frames"] == 10
    objects = [e["ranges"]["all"]["segmentation"]["car"]["objects"] for e in (one, other, both)]
    assert objects[2] == objects[0] + objects[1] > 0
    assert both["tracks"]["all"]["life"]["frames"] > 0
    assert 0 < both["metrics"]["all"]["HOTA"] <= 1
    summary = json.loads((drives["vlp-16"][0] / "summary.json").read_text())
    assert one["beta"] == pytest.approx(summary["beta"], abs=1e-6)


def test_report_and_what_else_counts(drives, tmp_path):
    done = modt("evaluate", *drives["vlp-16"], cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    for title in ("segmentation", "average precision", "precision of", "recall with", "tracks", "metrics"):
        assert title in done.stdout
    called = []
    for options in ((), ("--sector", "180", "--count", "cut")):
        done = modt("evaluate", *drives["vlp-16"], "--json", *options, cwd=tmp_path)
        classes = json.loads(done.stdout)["sensors"]["vlp-16"]["ranges"]["all"]["classification"]
        called.append(sum(score["called"] for score in classes.values()))
    assert called[0] < called[1]


def test_the_sector_is_that_of_the_truth(tmp_path):
    """A drive that is annotated on all sides is judged all round, and the report says so."""
    lines = []
    for name, options in (("ahead", ()), ("round", ("--all-around",))):
        out, drive = drive_and_run(tmp_path, seconds=0.3, options=options, name=name)
        lines.append(modt("evaluate", out, drive, cwd=tmp_path).stdout.split("\n"))
    assert lines[0][0].endswith("judged within 40 degrees of straight ahead")
    assert lines[1][0].endswith("judged all round")
    chosen = modt("evaluate", out, drive, "--sector", "60", cwd=tmp_path).stdout
    assert "judged within 60 degrees of straight ahead" in chosen.split("\n")[0]


def test_further_objects_are_added(drives, tmp_path):
    (tmp_path / "more.csv").write_text(
        f"{COLUMNS}\n0,1,Pedestrian,9,0,-1.7,1,1,2,0\n1,1,Pedestrian,9,0,-1.7,1,1,2,0\n"
    )
    done = modt("evaluate", *drives["vlp-16"], "--further", "more.csv", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert "--further adds 1 of them, in 2 labels" in done.stdout.split("\n")[1]
    bare = modt("evaluate", *drives["vlp-16"], cwd=tmp_path).stdout.split("\n")[1]
    assert "leave out road users, and tracks on those count as false" in bare
    done = modt("evaluate", *drives["vlp-16"], "--further", "more.csv", "--json", cwd=tmp_path)
    found = json.loads(done.stdout)["sensors"]["vlp-16"]
    assert (found["further_objects"], found["further_labels"], found["complete"]) == (1, 2, False)
    assert found["sectors_deg"] == [40]


def test_the_page_has_the_figures_and_their_plots(drives, tmp_path, chromium):
    done = modt("evaluate", *drives["vlp-16"], "--html", "page.html", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    with chromium.tab((tmp_path / "page.html").as_uri(), width=390, ready=LOADED) as tab:
        assert not tab.value(WIDE)
        assert done.stdout.strip() in tab.value("document.querySelector('pre').textContent")
        titles = tab.value("[...document.querySelectorAll('.plots h2')].map((title) => title.textContent)")
        assert len([title for title in titles if "by range" in title]) == 2
        assert tab.value("document.querySelectorAll('polyline').length") >= 3


def test_misuse_is_one_line_with_the_remedy(drives, tmp_path):
    run, truth = drives["vlp-16"]
    bare, cut, odd = (shutil.copytree(run, tmp_path / name) for name in ("bare", "cut", "odd"))
    shutil.rmtree(bare / "labels")
    (cut / "labels" / "000003.label").unlink()
    lines = (run / "tracks.jsonl").read_text().splitlines(keepends=True)
    (odd / "tracks.jsonl").write_text(lines[0] + lines[1].replace('"proposals":', '"proposals_":', 1) + lines[2])
    empty = shutil.copytree(run, tmp_path / "empty")
    (empty / "tracks.jsonl").write_text("")
    longer = shutil.copytree(run, tmp_path / "longer")
    (longer / "tracks.jsonl").write_text("".join(lines) + lines[-1].replace('"frame":4', '"frame":9'))
    boxless = shutil.copytree(run, tmp_path / "boxless")
    (boxless / "tracks.jsonl").write_text("".join(lines).replace('"box":{', '"bax":{'))
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
        ((run, tmp_path), "holds no labels that are recognised"),
        ((run, truth, "--further", broken), "broken.csv:2: 'Tree' is no type of an object"),
        ((run, truth, run, truth, "--further", broken), "--further: is for one drive"),
        ((boxless, truth, "--unlabelled", "found"), "tracks.jsonl:1: no record of a frame"),
        ((run, truth, "--json", "--unlabelled", "found"), "makes a list, and no evaluation"),
        ((run, truth, "--sector", "0"), "is no half sector"),
    ):
        done = modt("evaluate", *arguments, cwd=tmp_path)
        assert (done.returncode, done.stdout) == (2, "")
        assert message in done.stderr
        assert done.stderr.count("\n") == 1
