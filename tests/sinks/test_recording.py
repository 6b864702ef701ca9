"""Records of a service: parts within the limit, a full disk is waited out, nothing is lost in silence."""

import logging

import numpy as np
import pytest

from modt.config import RecordingConfig
from modt.sinks.recording import KEPT, RETRY_S, AtOnce, WholeRecording
from modt.sinks.run_directory import RunDirectory, status_paths
from tests.results import ledger_line
from tests.sinks.recordings import OURS, Time, begun, files_of_at_most, frame, frames, parts


@pytest.mark.parametrize("keep", KEPT)
def test_the_profile_decides_which_records_are_kept(tmp_path, keep):
    recording = begun(tmp_path, keep=keep)
    recording.write(frame(0))
    recording.ledger(ledger_line(0))
    recording.finish()
    assert {p.name for p in (tmp_path / "run").iterdir()} == {"run.yaml", *KEPT[keep]}


def test_a_disk_that_hangs_leaves_the_status_readable_in_memory(tmp_path, monkeypatch):
    monkeypatch.setattr("modt.sinks.run_directory.MEMORY", tmp_path)
    memory = status_paths(tmp_path / "run")[1]
    time = Time()
    recording = begun(tmp_path, time=time)
    recording.write_status("first")
    recording.keep_status("first")
    assert not memory.exists()
    for second in (1, 2, 3):  # the thread of the records does not return
        time.now += 1.0
        recording.keep_status(f"after {second} s")
    assert memory.read_text() == "after 3 s"
    recording.write_status("again")
    recording.keep_status("again")
    assert not memory.exists()


@pytest.mark.parametrize("keep", KEPT)
def test_a_directory_with_a_file_of_somebody_else_costs_the_records_alone(tmp_path, keep):
    (tmp_path / "run").mkdir()
    (tmp_path / "run" / "notes.txt").write_text("mine")
    recording = begun(tmp_path, keep=keep)
    recording.write(frame(0))
    recording.write_status("{}")
    recording.finish()
    assert [path.name for path in (tmp_path / "run").iterdir()] == ["notes.txt"]
    assert "holds notes.txt" in recording.health().failing
    assert recording.health().lost_lines == ("tracks.jsonl" in KEPT[keep])


@pytest.mark.slow
def test_all_parts_together_stay_within_the_limit_and_the_newest_lines_are_there(tmp_path):
    for start in range(2):  # over a restart as well
        recording = begun(tmp_path, disk_mb=1.0)
        for k in range(1500):
            recording.write(frame(1500 * start + k))
        recording.finish()
        files = [p for p in tmp_path.rglob("*") if p.is_file()]
        assert sum(p.stat().st_size for p in files) <= 1e6
    assert len(parts(tmp_path)) > 5
    kept = frames(tmp_path)
    assert kept == list(range(kept[0], 3000))


def test_a_full_disk_pauses_the_recording_until_there_is_room(tmp_path, caplog):
    time = Time()
    recording = begun(tmp_path, time=time)

    def write(numbers):
        for k in numbers:
            time.now += 0.1
            recording.write(frame(k))

    with caplog.at_level(logging.WARNING):
        with files_of_at_most(2000):
            write(range(50))
        write(range(50, 100))
    recording.finish()
    lost = sorted({*range(100)} - {*frames(tmp_path)})
    assert recording.health().lost_lines == len(lost)
    assert lost == list(range(lost[0], lost[-1] + 1))
    assert 50 <= lost[-1] <= 50 + RETRY_S / 0.1
    assert recording.health().pauses == 1
    assert ["recording pauses" in r.message for r in caplog.records] == [True, False]
    assert "recording again" in caplog.text
    assert recording.health().failing is None


def test_another_profile_changes_what_is_kept_and_the_description(tmp_path):
    recording = begun(tmp_path, keep="none")
    (tmp_path / "run" / "run.yaml").write_text("before")
    recording.configure(RecordingConfig(keep="tracks"))
    recording.write(frame(0))
    recording.finish()
    assert {p.name for p in (tmp_path / "run").iterdir()} == {"run.yaml", "tracks.jsonl"}
    assert (tmp_path / "run" / "run.yaml").read_text() == OURS


def test_lines_that_the_writer_has_no_room_for_are_counted(tmp_path, monkeypatch):
    recording = begun(tmp_path)
    dropped = []
    monkeypatch.setattr(AtOnce, "write", lambda _, job: dropped.append(job))
    monkeypatch.setattr(AtOnce, "health", lambda _: {"dropped": len(dropped)}, raising=False)
    recording.write(frame(0))
    recording.ledger(ledger_line(0))
    assert recording.health().lost_lines == 2


def test_beyond_the_bytes_of_a_day_frames_are_left_out_evenly_and_counted(tmp_path, monkeypatch):
    monkeypatch.setattr("modt.sinks.recording.WHOLE_BYTES", 10_000.0)
    time = Time()
    recording = begun(tmp_path, time=time, gb_per_day=0.1)
    for k in range(1000):
        time.now += 0.1
        recording.write(frame(k))
        recording.ledger(ledger_line(k))
    recording.finish()
    kept = frames(tmp_path)
    assert kept[:8] == list(range(8))
    steps = np.diff(kept[50:])
    assert max(steps) - min(steps) <= 1
    assert recording.health().thinned_lines == 1000 - len(kept)
    assert recording.health().lost_lines == 0
    size = (tmp_path / "run" / "tracks.jsonl").stat().st_size
    assert size <= 10_000 + 0.1e9 / 86_400 * time.now + 2_000


def test_a_replay_is_recorded_whole_whatever_the_profile_keeps(tmp_path):
    recording = WholeRecording(RunDirectory(tmp_path / "run"), lambda: "schema: modt.run/1\n", 3, None, labels=True)
    recording.start()
    recording.configure(RecordingConfig(keep="none"))
    for k in range(2):
        recording.write(frame(k))
        recording.ledger(ledger_line(k))
    recording.finish()
    assert frames(tmp_path) == [0, 1]
    names = {str(p.relative_to(tmp_path / "run")) for p in (tmp_path / "run").rglob("*") if p.is_file()}
    labels = {"labels/000000.label", "labels/000001.label"}
    assert names == {"run.yaml", "tracks.jsonl", "ledger.jsonl", "kitti/0003.txt", *labels}
    points = np.fromfile(tmp_path / "run" / "labels" / "000001.label", np.uint32)  # track and class of each, in order
    assert (points >> 16).tolist() == [1] * 5 + [2] * 4 + [0] * 31
    assert (points & 0xFFFF).tolist() == [1] * 5 + [0] * 35
