"""`modt evaluate` from the outside: recorded runs, and the experiments of the paper."""

import csv
import json
import shutil

import pytest

from tests.cli.commands import content, here, refusal, succeeded
from tests.recorded import drive_and_run
from tests.viewer.chromium import LOADED, WIDE

pytestmark = pytest.mark.command


@pytest.fixture(scope="module")
def drives(tmp_path_factory):
    """Two synthetic drives and the runs on them, by sensor."""
    root = tmp_path_factory.mktemp("drives")
    return {sensor: drive_and_run(root, sensor) for sensor in ("vlp-16", "hdl-32e")}


def test_the_page_has_the_figures_and_their_plots(drives, tmp_path, chromium):
    done = succeeded("evaluate", *drives["vlp-16"], "--html", "page.html", cwd=tmp_path)
    with chromium.tab((tmp_path / "page.html").as_uri(), width=390, ready=LOADED) as tab:
        assert not tab.value(WIDE)
        assert done.stdout.strip() in tab.value("document.querySelector('pre').textContent")
        titles = tab.value("[...document.querySelectorAll('.plots h3')].map((title) => title.textContent)")
        assert len([title for title in titles if "by range" in title]) == 2
        assert tab.value("document.querySelectorAll('.plots svg').length") == len(titles) == 4


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
    summary = content(drives["vlp-16"][0] / "summary.json")
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

    bare = copy("bare")
    cut = copy("cut")
    empty = copy("empty", [])
    shutil.rmtree(bare / "labels")
    (cut / "labels" / "000003.label").unlink()
    longer = copy("longer", [*lines, lines[-1].replace('"frame":4', '"frame":9')])
    for arguments, message in (
        ((bare, truth), "modt replay --labels"),
        ((cut, truth), "000003.label: cannot be read"),
        ((empty, truth), "no frames are recorded"),
        ((longer, truth), "frame 9 is not in the truth"),
        ((run, drives["hdl-32e"][1]), "labels for a scan of"),
        ((run,), "are no pairs"),
        ((tmp_path, truth), "describes no run"),
        ((run, truth, "--further", "none.csv"), "none.csv: cannot be read"),
        ((run, truth, run, truth, "--further", "none.csv"), "--further: is for one drive"),
        ((run, truth, "--json", "--unlabelled", "found"), "makes a list, and no evaluation"),
        ((run, truth, "--sector", "0"), "is no half sector"),
    ):
        assert message in refusal(capsys, "evaluate", *arguments)


def test_results_are_written_as_a_table_and_a_document(tmp_path):
    """Those of swept experiments and of one that is not, with another profile beside the first."""
    (tmp_path / "other.yaml").write_text("fusion:\n  start_frame: 1\n")
    words = ["evaluate", "--experiment", "table4", "fig11", "fig12", "--simulated", "2", "--seconds", "0.2"]
    assert here(*words, "--beside", tmp_path / "other.yaml", "--out", tmp_path) == 0
    with (tmp_path / "results.csv").open() as file:
        rows = list(csv.DictReader(file))
    swept = {row["at"] for row in rows if row["experiment"] == "fig12" and row["quantity"] == "beta"}
    assert swept == {f"{metres}.0" for metres in range(10, 80, 10)}
    assert {(row["kind"], row["paper"]) for row in rows} == {("simulated", "")}, "beside no figure of the paper"
    assert [row["profile"] for row in rows].count("default") == len(rows) / 2
    page = (tmp_path / "results.md").read_text()
    assert all(f"## {title}" in page for title in ("Table IV", "Fig. 11", "Fig. 12"))
    charts = (tmp_path / "results.html").read_text()
    assert all(f"<h2>{title}" in charts for title in ("Table IV", "Fig. 11", "Fig. 12"))
    assert "AP pedestrian, 2 simulated drives</h3>" in charts
    assert all(words in charts for words in ("paper, with_trk", "paper, best", "paper, ten times Fig. 8"))


@pytest.mark.slow
def test_runs_judged_by_several_processes_have_the_same_figures(drives, capsys):
    pytest.importorskip("distributed")
    pairs = [path for pair in drives.values() for path in pair]
    found = []
    for jobs in (1, 2):
        assert here("evaluate", *pairs, "--jobs", jobs, "--quiet", "--json") == 0
        found.append(capsys.readouterr().out)
    assert found[0] == found[1]


@pytest.mark.parametrize(
    ("words", "named"),
    [
        (["--experiment", "table9", "--simulated", "1"], "table3"),
        (["--experiment", "table9", "--experiment", "table4", "--simulated", "1"], "table9"),
        (["--experiment", "table4"], "no drives"),
        (["RUN", "TRUTH", "--experiment", "table4"], "takes no runs"),
        (["--experiment", "table3", "--simulated", "1"], "none of the drives"),
        (["--experiment", "table4", "--simulated", "1", "--further", "table.csv"], "--further"),
    ],
)
def test_misuse_of_experiments_is_one_line(words, named, capsys, tmp_path):
    assert named in refusal(capsys, "evaluate", *words, "--out", tmp_path)


def test_a_run_of_two_sensors_is_judged_in_the_frame_of_the_robot(tmp_path, capsys):
    places = {"front": ([0.5, 0.35, 0.6], [0, 0, 45]), "rear": ([-0.5, -0.35, 0.6], [0, 0, -135])}
    sensors = {
        name: {"profile": "vlp-16", "source": "velodyne://", "position_m": place, "roll_pitch_yaw_deg": turn}
        for name, (place, turn) in places.items()
    }
    (tmp_path / "robot.yaml").write_text(json.dumps({"sensors": sensors}))
    sim = tmp_path / "sim"
    assert (
        here("simulate", "--profile", tmp_path / "robot.yaml", "--seconds", "0.5", "--seed", "5", "--out", sim) == 0
    )
    run = tmp_path / "run"
    options = ("--profile", sim / "robot.yaml", "--labels", "--quiet", "--core", "none", "--out", run)
    assert here("replay", *options) == 0
    (scores,) = json.loads(evaluated(capsys, run, sim, "--json"))["sensors"].values()
    cars = scores["ranges"]["0-20"]["segmentation"]["car"]
    assert cars["objects"] > 10
    assert cars["recall"] > 0.8
