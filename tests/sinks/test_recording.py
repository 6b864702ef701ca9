"""Records of a service: parts within the limit, a full disk is waited out, nothing is lost in silence."""

import dataclasses
import json
import logging
import shutil
from contextlib import suppress
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from modt.config import RecordingConfig
from modt.sinks.recording import KEPT, RETRY_S, WholeRecording
from modt.sinks.run_directory import RunDirectory, status_paths
from tests.results import ledger_line
from tests.sinks.recordings import OURS, Disk, Queue, Time, begun, files_of_at_most, frame, frames, parts


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


def test_lines_that_the_writer_has_no_room_for_are_counted(tmp_path):
    queue = Queue(2)
    recording = begun(tmp_path, writer=queue)  # beginning the first part is a job
    recording.write(frame(0))
    recording.ledger(ledger_line(0))
    recording.write(frame(1))
    recording.ledger(ledger_line(1))
    assert recording.health().lost_lines == 2
    assert recording.health().fates == {"written": 0, "waiting": 1, "dropped": 1}


def test_a_frame_whose_line_has_no_number_counts_as_lost(tmp_path):
    recording = begun(tmp_path)
    with pytest.raises(ValueError, match="JSON compliant"):
        recording.write(dataclasses.replace(frame(0), T_world_sensor=np.full((4, 4), np.nan)))
    recording.write(frame(1))
    recording.finish()
    assert recording.health().fates == {"written": 1, "waiting": 0, "not_encoded": 1}
    assert recording.health().lost_lines == 1


@pytest.mark.parametrize("hangs", [False, True])
def test_the_last_document_knows_the_fate_of_lines_that_waited(tmp_path, hangs):
    queue = Queue(100)
    recording = begun(tmp_path, writer=queue)
    for k in range(5):
        recording.write(frame(k))
    queue.at_end = 3 if hangs else 100  # the first part is begun, and two lines are written
    recording.end(lambda health: {"status.json": json.dumps(dataclasses.asdict(health))})
    assert frames(tmp_path) == list(range(2 if hangs else 5))
    fates = {"written": 2, "waiting": 0, "dropped": 3} if hangs else {"written": 5, "waiting": 0}
    assert recording.health().fates == fates
    status = tmp_path / "run" / "status.json"
    assert hangs or json.loads(status.read_text())["fates"] == fates
    recording.finish()


EVENTS = st.one_of(
    st.sampled_from(["write", "write", "nan", "ledger", "status", "full", "room", "unsynced", "synced", "remove"]),
    st.integers(1, 8),
)


@given(events=st.lists(EVENTS, max_size=60), depth=st.integers(1, 12), at_end=st.integers(0, 40), hangs=st.booleans())
@settings(max_examples=150, deadline=None)
def test_each_frame_is_written_or_lost_for_one_reason_in_any_order_of_faults(events, depth, at_end, hangs):
    """The queue is run by numbers among the events, and after the last one for `at_end` jobs; then it may hang."""
    given_frames = 0
    disk = Disk()
    with TemporaryDirectory() as name, disk.installed():
        folder = Path(name)
        queue = Queue(depth, Time())
        recording = begun(folder, writer=queue, time=queue.time)
        for event in events:
            queue.time.now += 0.3
            if isinstance(event, int):
                queue.run(event)
            elif event == "ledger":
                recording.ledger(ledger_line(given_frames))
            elif event == "status":
                queue.write(lambda: recording.write_status("{}"))
            elif event == "remove":
                shutil.rmtree(folder / "run", ignore_errors=True)
            elif event in ("write", "nan"):
                result = frame(given_frames)
                T = result.T_world_sensor * (np.nan if event == "nan" else 1.0)
                with suppress(ValueError):
                    recording.write(dataclasses.replace(result, T_world_sensor=T))
                given_frames += 1
            else:
                disk.event(event)
            health = recording.health()
            assert sum(health.fates.values()) == given_frames
        queue.at_end = at_end
        queue.hangs = hangs
        recording.end(lambda health: {})
        queue.run(1)  # the disk that hung does its work after the end
        recording.finish()
        fates = recording.health().fates
        assert sum(fates.values()) == given_frames
        assert fates["waiting"] == 0
        kept = frames(folder)
        assert len(kept) == len({*kept})
        assert fates["written"] <= len(kept) <= fates["written"] + fates.get("not_synced", 0) + fates.get("held", 0)


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
