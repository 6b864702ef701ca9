"""Records of a service: parts within the limit, a full disk is waited out, nothing is lost in silence."""

import errno
import json
import logging

import numpy as np
import pytest

from modt.config import RecordingConfig
from modt.sinks import output
from modt.sinks.recording import KEPT, RETRY_S, AtOnce, Recording, WholeRecording
from modt.sinks.run_directory import MARK, RunDirectory
from modt.sinks.tracks import SCHEMA
from modt_desk.reporting.records import read_records
from tests.results import CAR, result

OURS = f"schema: modt.run/1\n{MARK}\n"


class Full(AtOnce):
    """A writer that has no room once it is full."""

    full, dropped = False, 0

    def write(self, job):
        self.dropped += self.full
        if not self.full:
            job()

    def health(self):
        return {"dropped": self.dropped}


class Time:
    now = 0.0

    def __call__(self):
        return self.now


def made(path, background=None, time=None, **config):
    directory = RunDirectory(path / "run")
    writer = background or AtOnce()
    recording = Recording(directory, RecordingConfig(**config), writer, lambda: OURS, time or Time())
    recording.start()
    return recording


def frame(k):
    return result(k, [5, 4], {0: 1, 1: 2}, {1: CAR})


@pytest.mark.parametrize("keep", KEPT)
def test_the_profile_says_what_is_kept(tmp_path, keep):
    recording = made(tmp_path, keep=keep)
    recording.write(frame(0))
    recording.ledger({"schema": "modt.ledger/1", "frame": 0})
    recording.finish()
    assert {p.name for p in (tmp_path / "run").iterdir()} == {"run.yaml", *KEPT[keep]}


@pytest.mark.slow
def test_all_parts_together_stay_within_the_limit_and_the_newest_lines_are_there(tmp_path):
    for start in range(2):  # over a restart as well
        recording = made(tmp_path, disk_mb=1.0)
        for k in range(2500):
            recording.write(frame(10_000 * start + k))
        recording.finish()
        files = [p for p in tmp_path.rglob("*") if p.is_file()]
        assert sum(p.stat().st_size for p in files) <= 1e6
    assert recording.parts > 8
    parts = sorted((p for p in tmp_path.iterdir() if "~" in p.name), key=lambda p: int(p.name.partition("~")[2]))
    kept = [r["frame"] for p in [*parts, tmp_path / "run"] for r in read_records(p / "tracks.jsonl", SCHEMA)]
    assert kept == list(range(kept[0], 12_500))


class FullDisk:
    """Files that take so many bytes in all."""

    def __init__(self, monkeypatch, bytes_free):
        self.free = bytes_free
        real = output.LineFile.write

        def write(file, item):
            with output.writing(file.path):
                if len(item) > self.free:
                    raise OSError(errno.ENOSPC, "No space left on device")
            self.free -= len(item)
            real(file, item)

        monkeypatch.setattr(output.LineFile, "write", write)


def test_a_full_disk_pauses_the_recording_until_there_is_room(tmp_path, monkeypatch, caplog):
    time, disk = Time(), FullDisk(monkeypatch, 2000)
    recording = made(tmp_path, time=time)
    with caplog.at_level(logging.WARNING):
        for k in range(100):
            time.now += 0.1
            if k == 50:
                disk.free = 1e9
            recording.write(frame(k))
    recording.finish()
    kept = [r["frame"] for r in read_records(tmp_path / "run" / "tracks.jsonl", SCHEMA)]
    lost = sorted({*range(100)} - {*kept})
    assert recording.health()["lost_lines"] == len(lost)
    assert lost == list(range(lost[0], lost[-1] + 1))
    assert 50 <= lost[-1] <= 50 + RETRY_S / 0.1
    assert recording.pauses == 1
    assert ["recording pauses" in r.message for r in caplog.records] == [True, False]
    assert "recording again" in caplog.text
    assert recording.cause is None


def test_another_profile_changes_what_is_kept_and_the_description(tmp_path):
    recording = made(tmp_path, keep="none")
    (tmp_path / "run" / "run.yaml").write_text("before")
    recording.follow(RecordingConfig(keep="tracks"))
    recording.write(frame(0))
    recording.finish()
    assert {p.name for p in (tmp_path / "run").iterdir()} == {"run.yaml", "tracks.jsonl"}
    assert (tmp_path / "run" / "run.yaml").read_text() == OURS


def test_lines_that_the_writer_has_no_room_for_are_counted(tmp_path):
    background = Full()
    recording = made(tmp_path, background)
    background.full = True
    recording.write(frame(0))
    recording.ledger(json.loads("{}"))
    assert recording.health()["lost_lines"] == 2


def test_beyond_the_bytes_of_a_day_frames_are_left_out_evenly_and_counted(tmp_path, monkeypatch):
    monkeypatch.setattr("modt.sinks.recording.WHOLE_BYTES", 10_000.0)
    time = Time()
    recording = made(tmp_path, time=time, gb_per_day=0.1)
    for k in range(2000):
        time.now += 0.1
        recording.write(frame(k))
        recording.ledger({"schema": "modt.ledger/1", "frame": k})
    recording.finish()
    kept = [r["frame"] for r in read_records(tmp_path / "run" / "tracks.jsonl", SCHEMA)]
    assert kept[:8] == list(range(8))
    steps = np.diff(kept[50:])
    assert max(steps) - min(steps) <= 1
    assert recording.health()["thinned_lines"] == 2000 - len(kept)
    assert recording.health()["lost_lines"] == 0
    size = (tmp_path / "run" / "tracks.jsonl").stat().st_size
    assert size <= 10_000 + 0.1e9 / 86_400 * time.now + 2_000


def test_a_replay_is_recorded_whole_whatever_the_profile_keeps(tmp_path):
    recording = WholeRecording(RunDirectory(tmp_path / "run"), lambda: "schema: modt.run/1\n", 3, None, labels=True)
    recording.start()
    recording.follow(RecordingConfig(keep="none"))
    for k in range(2):
        recording.write(frame(k))
        recording.ledger({"schema": "modt.ledger/1", "frame": k})
    recording.finish()
    assert [r["frame"] for r in read_records(tmp_path / "run" / "tracks.jsonl", SCHEMA)] == [0, 1]
    names = {str(p.relative_to(tmp_path / "run")) for p in (tmp_path / "run").rglob("*") if p.is_file()}
    labels = {"labels/000000.label", "labels/000001.label"}
    assert names == {"run.yaml", "tracks.jsonl", "ledger.jsonl", "kitti/0003.txt", *labels}
