"""Recordings of a service, and disks that are full."""

import resource
import signal
from contextlib import contextmanager
from unittest.mock import Mock, patch

from modt.config import RecordingConfig
from modt.errors import ModtError
from modt.sinks.background import Background
from modt.sinks.output import LineFile
from modt.sinks.recording import AtOnce, Recording, count_dropped
from modt.sinks.run_directory import MARK, RunDirectory
from modt.sinks.tracks import SCHEMA
from modt_profiling.reporting.records import read_records
from tests.results import TWO, result

OURS = f"schema: modt.run/1\n{MARK}\n"


class Time:
    now = 0.0

    def __call__(self):
        return self.now


class Queue(Background):
    """The queue of a recording. The test is its thread: `run` runs jobs, `close` as many as `at_end` says."""

    def __init__(self, depth, time=None):
        self.time = time or Time()
        self.at_end = 0
        self.hangs = False  # at the end, with the next job in work
        self._held = None
        with patch("threading.Thread", return_value=Mock(join=self._join, is_alive=lambda: self.hangs)):
            super().__init__("recording", AtOnce(), depth, on_drop=count_dropped, retry_s=0.0, clock=self.time)

    def run(self, n):
        """Run at most n jobs, the one first that hung."""
        if self._held is not None:
            self._attempt(self._held)
            self._held = None
        while n and self._jobs and (job := self._next()) is not None:
            self._attempt(job)
            n -= 1

    def _join(self, limit_s):
        self.run(self.at_end)
        if self.hangs and self._jobs:
            self._held = self._next()
        self.time.now += limit_s


class Disk:
    """A disk that may be full, or refuse to sync."""

    def __init__(self):
        self._full = False
        self._unsynced = False

    def event(self, name):
        """Begin or end a fault."""
        self._full = {"full": True, "room": False}.get(name, self._full)
        self._unsynced = {"unsynced": True, "synced": False}.get(name, self._unsynced)

    @contextmanager
    def installed(self):
        """The disk of all files of lines."""
        write = LineFile.write
        sync = LineFile.sync

        def written(file, item):
            if self._full:
                raise ModtError(file.path, "full", "free it")
            write(file, item)

        def synced(file):
            if self._unsynced:
                raise ModtError(file.path, "failed", "replace it")
            sync(file)

        with patch.object(LineFile, "write", written), patch.object(LineFile, "sync", synced):
            yield


def begun(folder, writer=None, time=None, **config):
    """A recording into the directory `run`."""
    settings = RecordingConfig(**config)
    recording = Recording(RunDirectory(folder / "run"), settings, writer or AtOnce(), lambda: OURS, time or Time())
    recording.start()
    return recording


def frame(k):
    return result(k, *TWO)


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
