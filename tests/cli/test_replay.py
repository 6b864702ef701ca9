"""`modt replay` from the outside: the files it leaves, the text it prints, the way it ends."""

import json
import os
import resource
import signal
import time

import numpy as np
import pytest

from modt import profile
from modt.sinks.tracks import SCHEMA
from modt_commands.profile import main as modt_profile
from modt_profiling.reporting.records import read_records
from modt_simulation.synthetic_stream import SyntheticStream
from tests.sources import layouts

from .commands import begin, content, here, modt, refusal, succeeded

pytestmark = pytest.mark.command

MODES = ("conventional", "efficient", "accurate")
FRAMES = 6


@pytest.fixture(scope="module")
def runs(tmp_path_factory):
    """Folder of a replay of the embedded stream in every mode."""
    root = tmp_path_factory.mktemp("runs")
    options = ("--frames", f"0:{FRAMES}", "--labels", "--out")
    for mode in MODES[:2]:
        assert here("replay", "--mode", mode, *options, root / mode) == 0
    done = succeeded("replay", "--mode", "accurate", *options, "accurate", cwd=root)
    assert "results in accurate" in done.stdout
    assert "%|" not in done.stderr, "no bar in a pipe"
    return root


def tracks(run):
    return list(read_records(run / "tracks.jsonl", SCHEMA))


@pytest.mark.parametrize("mode", MODES)
def test_run_directory_has_the_documented_files(runs, mode):
    names = sorted(p.name for p in (runs / mode).iterdir())
    assert names == ["kitti", "labels", "ledger.jsonl", "run.yaml", "summary.json", "tracks.jsonl"]
    frames = tracks(runs / mode)
    assert [f["frame"] for f in frames] == list(range(FRAMES))
    lines = map(json.loads, (runs / mode / "ledger.jsonl").read_text().splitlines())
    booked = [line["stages"] for line in lines if "frame" in line]
    assert [b["tracking"]["items"] for b in booked] == [len(f["tracks"]) for f in frames]
    for b, frame in zip(booked, frames, strict=True):  # tracking merges and splits proposals
        assert b["odometry"]["items"] == b["segmentation"]["items"] >= 0.9 * frame["proposals"] > 0


@pytest.mark.parametrize("mode", MODES)
def test_report_and_summary_agree_with_the_records(runs, mode, capsys):
    written = content(runs / mode / "summary.json")
    assert here("report", runs / mode, "--json", program=modt_profile) == 0
    report = json.loads(capsys.readouterr().out)
    assert report["frames"] == written["frames"] == FRAMES
    assert report["gross_J"]["value"] > 0
    saved = {name: report["saved"][name]["value"] for name in ("beta", "N_go", "proposals")}
    assert list(saved.values()) == [written["beta"], written["tracks"]["N_go"], written["proposals_per_frame"]]
    assert sum(f["classifications"] for f in tracks(runs / mode)) == written["classifications"]


def test_run_yaml_and_the_summary_describe_the_run(runs):
    host = content(runs / "accurate/summary.json")["host"]
    assert host["core"] == max(os.sched_getaffinity(0))
    assert host["one_core_verified"] is True
    facts = content(runs / "accurate/run.yaml")
    assert facts["schema"] == "modt.run/1"
    assert facts["mode"] == "accurate"
    assert len(facts["model"]["sha256"]) == 64
    assert {"python", "modt", "numpy", "onnxruntime"} <= set(facts["versions"])
    assert profile.parse(profile.to_yaml(facts["profile"])) == profile.load()


def test_lines_go_once_to_every_sink_asked_for_and_a_second_run_is_the_same_byte_for_byte(runs, tmp_path):
    sinks = ("-", "-", f"file://{tmp_path}/lines.jsonl", f"unix://{tmp_path}/gone.sock")
    options = (word for sink in sinks for word in ("--sink", sink))
    done = succeeded(
        "replay", "--frames", f"0:{FRAMES}", "--quiet", "--labels", "--out", "run", *options, cwd=tmp_path
    )
    assert done.stdout == (tmp_path / "lines.jsonl").read_text() == (runs / "accurate" / "tracks.jsonl").read_text()
    for name in ("tracks.jsonl", "kitti/0000.txt", "labels/000003.label"):
        assert (tmp_path / "run" / name).read_bytes() == (runs / "accurate" / name).read_bytes()
    assert done.stderr.count("nobody receives") == 1
    health = content(tmp_path / "run/summary.json")["sinks"]
    assert [(found["written"], found["failed"]) for found in health.values()] == [(FRAMES, 0)] * 2 + [(0, FRAMES)]


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["nowhere"], ["nowhere", "no such file"]),
        (["--profile", "bad.yaml"], ["bad.yaml:2", "cell_m", "out of range"]),
        (["--profile", "fake.yaml"], ["fake.onnx"]),
        (["--core", "4096"], ["core 4096", "--core none"]),
        (["--frames", "900:901"], ["no frames in 900:901"]),
        (["--frames", "5:2"], ["--frames"]),
        (["--rate", "0"], ["--rate"]),
        (["scans", "--fov", "camera"], ["no calibration", "--fov full"]),
        (["--out", "foreign"], ["foreign", "no record"]),
        (["scans", "foreign"], ["foreign", "modt batch"]),
    ],
)
def test_misuse_is_one_line_and_status_2(tmp_path, monkeypatch, capsys, arguments, words):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "bad.yaml").write_text("segmentation:\n  cell_m: -3\n")
    (tmp_path / "fake.yaml").write_text("classification:\n  model: ./fake.onnx\n")
    (tmp_path / "fake.onnx").write_bytes(b"not a network")
    (tmp_path / "foreign").mkdir()
    (tmp_path / "foreign" / "thesis").write_text("mine")
    layouts.bare(tmp_path)
    line = refusal(capsys, "replay", *arguments)
    assert all(word in line for word in words), line


def test_bad_scans_are_counted_and_the_rest_goes_on(tmp_path, capsys, caplog):
    folder = layouts.bare(tmp_path)
    (folder / "000001.bin").write_bytes(b"cut")
    assert here("replay", folder, "--out", tmp_path / "run") == 3
    assert [f["frame"] for f in tracks(tmp_path / "run")] == [0, 2]
    summary = content(tmp_path / "run/summary.json")
    assert summary["faults"]["skipped"] == 1
    assert "truncated" in caplog.text
    said = capsys.readouterr()
    assert "1 of them skipped" in said.out
    assert "not all was read: 2 frames of 3 messages; left out: 1 x truncated" in said.err
    read = summary["read"]
    assert (read["messages"], read["sweeps"], read["used"], read["poses"]) == (3, 3, 2, "registration")
    assert list(read["left_out"].values()) == [1]
    assert content(tmp_path / "run/run.yaml")["stream"]["read"] == read


@pytest.mark.parametrize(("scale", "unlit"), [("hdl-64e", 2), ("none", 0)])
def test_frames_without_reflectance_are_counted_where_the_sensor_has_it(tmp_path, scale, unlit, capsys, caplog):
    folder = tmp_path / "scans"
    folder.mkdir()
    for frame in SyntheticStream("street", "hdl-64e", 0.3, seed=0):
        points = frame.points * np.float32([1, 1, 1, frame.index == 1])
        (folder / f"{frame.index:06d}.bin").write_bytes(points.tobytes())
    (tmp_path / "own.yaml").write_text(f"sensor:\n  reflectance: {scale}\n")
    assert here("replay", folder, "--profile", tmp_path / "own.yaml", "--out", tmp_path / "run") == 0
    faults = content(tmp_path / "run/summary.json")["faults"]
    assert faults == {"count": 0, "skipped": 0, "first": None, "frames_without_reflectance": unlit}
    assert ("without reflectance: 2 frames" in capsys.readouterr().out) is (unlit > 0)
    assert caplog.text.count("has no reflectance") == (unlit > 0)


def test_a_full_disk_is_one_line_and_what_was_recorded_stays(tmp_path):
    def small_files():
        resource.setrlimit(resource.RLIMIT_FSIZE, (200_000, 200_000))

    done = modt("replay", "--frames", "0:30", "--out", "run", cwd=tmp_path, preexec_fn=small_files)
    assert done.returncode == 1, done.stderr
    assert "Traceback" not in done.stderr
    assert "free" in done.stderr.splitlines()[-1]
    kept = tracks(tmp_path / "run")
    assert [f["frame"] for f in kept] == list(range(len(kept)))
    assert kept


def wait_for_frames(run, n):
    """Until the run has recorded that many frames."""
    for _ in range(600):
        path = run / "tracks.jsonl"
        if path.exists() and path.read_bytes().count(b"\n") >= n:
            return
        time.sleep(0.1)
    raise AssertionError("no frames came")


@pytest.mark.parametrize(("number", "status"), [(signal.SIGINT, 130), (signal.SIGTERM, 0)])
def test_a_signal_ends_the_run_well(tmp_path, number, status):
    process = begin("replay", "--rate", "10", "--out", "run", cwd=tmp_path)
    wait_for_frames(tmp_path / "run", 2)
    process.send_signal(number)
    _, errors = process.communicate(timeout=60)
    assert process.returncode == status
    assert "Traceback" not in errors
    assert signal.Signals(number).name in errors.splitlines()[-1]
    summary = content(tmp_path / "run/summary.json")
    assert summary["frames"] == len(tracks(tmp_path / "run"))
    assert summary["run"]["stopped_by"] == signal.Signals(number).name


@pytest.mark.kitti
def test_a_real_drive_in_the_cameras_view(drive_0005, tmp_path):
    succeeded("replay", drive_0005, "--fov", "camera", "--frames", "0:12", "--out", "run", cwd=tmp_path)
    frames = tracks(tmp_path / "run")
    assert len(frames) == 12
    assert 15 < np.mean([f["proposals"] for f in frames]) < 120
    heard = {t["class"] for t in frames[-1]["tracks"]}
    assert "car" in heard
