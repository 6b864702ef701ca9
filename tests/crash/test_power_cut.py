"""After a power cut at any moment: what was synced is there, and a restart works and keeps to its limit."""

from __future__ import annotations

import pytest

from modt.config import RecordingConfig
from modt.sinks.recording import AtOnce, Recording
from modt.sinks.run_directory import MARK, RunDirectory
from modt.sinks.tracks import SCHEMA
from modt_desk.reporting.records import read_records
from tests.crash.power_cut import PowerCuts
from tests.results import CAR, result
from tests.sinks.test_recording import Time

OURS = f"schema: modt.run/1\n{MARK}\n"
FRAMES, A_SECOND = 50, 5


def recorded(folder, time=None):
    config = RecordingConfig(disk_mb=1.0)
    recording = Recording(RunDirectory(folder / "run"), config, AtOnce(), lambda: OURS, time or Time())
    recording.start()
    return recording


def parts(folder):
    """Parts of a service, the oldest first."""
    kept = sorted((p for p in folder.glob("run~*")), key=lambda p: int(p.name.partition("~")[2]))
    return [*kept, *(p for p in [folder / "run"] if p.exists())]


def frames(folder):
    found = (part / "tracks.jsonl" for part in parts(folder))
    return [record["frame"] for path in found if path.exists() for record in read_records(path, SCHEMA)]


@pytest.fixture(name="disk", scope="module")
def disks(tmp_path_factory):
    """A service that ran for some seconds, was started again, and began new parts on the way."""
    disk = PowerCuts(tmp_path_factory.mktemp("disk"))
    with disk.watch():
        for start in (0, FRAMES // 2):
            recording = recorded(disk.root)
            for k in range(start, start + FRAMES // 2):
                if k % 12 == 11:
                    recording._bytes = 1_000_000  # the part is full
                recording.write(result(k, [5, 4], {0: 1, 1: 2}, {1: CAR}))
                recording.ledger({"schema": "modt.ledger/1", "frame": k})
                if k % A_SECOND == A_SECOND - 1:
                    recording.sync()
                    disk.safe = k + 1
                disk.note()
            recording.finish()
    return disk


@pytest.mark.parametrize("kind", ["lost", "named", "kept"])
def test_what_was_synced_is_there_and_a_restart_works(disk, kind, tmp_path):
    cuts = [(state, safe) for of, state, safe in disk.cuts if of == kind]
    assert len(cuts) > 20
    for number, (state, safe) in enumerate(cuts):
        folder = tmp_path / str(number)
        state.write(disk.number, folder)
        whole = frames(folder)
        assert whole == list(range(len(whole)))
        assert len(whole) >= safe
        recording = recorded(folder)
        recording.write(result(1000, [5, 4], {0: 1, 1: 2}, {1: CAR}))
        recording.finish()
        assert recording.cause is None
        assert frames(folder)[-1] == 1000
        assert frames(folder)[:-1] == whole
        assert recording.directory.kept() == parts(folder)[:-1]  # all are known as its own, and will be trimmed
