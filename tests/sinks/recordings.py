"""Recordings of a service, and disks that are full."""

import resource
import signal
from contextlib import contextmanager

from modt.config import RecordingConfig
from modt.sinks.recording import AtOnce, Recording
from modt.sinks.run_directory import MARK, RunDirectory
from modt.sinks.tracks import SCHEMA
from modt_profiling.reporting.records import read_records
from tests.results import CAR, result

OURS = f"schema: modt.run/1\n{MARK}\n"


class Time:
    now = 0.0

    def __call__(self):
        return self.now


def begun(folder, writer=None, time=None, **config):
    """A recording into the directory `run`."""
    settings = RecordingConfig(**config)
    recording = Recording(RunDirectory(folder / "run"), settings, writer or AtOnce(), lambda: OURS, time or Time())
    recording.start()
    return recording


def frame(k):
    return result(k, [5, 4], {0: 1, 1: 2}, {1: CAR})


def parts(folder):
    """Directories of the recording, the oldest first."""
    kept = sorted(folder.glob("run~*"), key=lambda path: int(path.name.partition("~")[2]))
    return [*kept, *(path for path in [folder / "run"] if path.exists())]


def frames(folder):
    """Numbers of the frames that are recorded in all parts."""
    found = (part / "tracks.jsonl" for part in parts(folder))
    return [record["frame"] for path in found if path.exists() for record in read_records(path, SCHEMA)]


@contextmanager
def files_of_at_most(n_bytes):
    """A disk on which no file grows beyond a size, for this process."""
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    assert signal.getsignal(signal.SIGXFSZ) is signal.SIG_IGN
    resource.setrlimit(resource.RLIMIT_FSIZE, (n_bytes, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
