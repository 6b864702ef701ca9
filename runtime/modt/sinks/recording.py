"""Records of a run. Those of a service are written by a thread of their own, in parts of limited size."""

from __future__ import annotations

import logging
import time
from collections.abc import Callable
from contextlib import suppress
from typing import TYPE_CHECKING, Any

from modt.config import RecordingConfig
from modt.errors import ModtError
from modt.geometry import Camera
from modt.sinks.kitti import KittiResults, PointLabels
from modt.sinks.output import Health, LineFile, Sink, Writer
from modt.sinks.records import line
from modt.sinks.run_directory import LEDGER, RUN, STATUS, TRACKS, RunDirectory
from modt.sinks.tracks import frame_line
from modt.types import FrameResult

if TYPE_CHECKING:
    from modt.sinks.background import Background

log = logging.getLogger(__name__)

KEPT = {"all": (TRACKS, LEDGER), "tracks": (TRACKS,), "ledger": (LEDGER,), "none": ()}
PARTS = 8
"""Number of parts that share the limit `disk_mb`."""
RESERVED_BYTES = 20_000
"""Bytes of each part that are kept for run.yaml, status.json and summary.json."""
RETRY_S = 1.0
"""Time from a failure to the next attempt to write [s]."""
WHOLE_BYTES = 5e8
"""Records of frames that are written whole before `gb_per_day` thins them, so that a run on a desk loses no frame."""
DAY_S = 86_400.0
JOBS = 128
"""Length of the queue of jobs."""
CLOSE_S = 1.0
"""Time limit for the last jobs of a service [s]. Half of it is reserved for draining the queue."""
Job = Callable[[], None]


class AtOnce(Writer[Job]):
    """Runs jobs where they are handed over."""

    def write(self, job: Job, /) -> None:
        """Run it."""
        job()

    def health(self) -> Health:
        """No job is ever dropped."""
        return {"dropped": 0}


class Recording(Sink):
    """tracks.jsonl and ledger.jsonl. While they cannot be written, lines are lost and counted.

    Once a second it checks that its files are in place, and begins another part if they were removed or moved.

    Args:
        directory: directory of the records.
        config: choice of the records and their limits.
        writer: runs what writes, in a thread; `write`, `ledger`, `start` and `follow` are for the loop, the rest for
            that thread.
        describe: text of run.yaml for a new part.

    Attributes:
        lines: number written.
        lost: number of those that could not be written, or may be missing since their file was removed or not synced.
        thinned: number left out to keep to `gb_per_day`.
        pauses, parts: number of times that writing failed, and of parts begun.
        cause: why nothing can be written now, or None.
    """

    def __init__(
        self,
        directory: RunDirectory,
        config: RecordingConfig,
        writer: Background[Job] | AtOnce,
        describe: Callable[[], str],
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self.directory, self.config = directory, config
        self.lines = self.lost = self.thinned = self.pauses = self.parts = 0
        self.cause: str | None = None
        self.writer, self._describe, self._clock = writer, describe, clock
        self._files: dict[str, LineFile[str]] = {}
        self._begun, self._bytes, self._retry_s = False, 0, float("-inf")
        self._unsynced, self._named = 0, 0  # lines, and files, that a power cut may take
        self._allowed_bytes, self._allowed_s = WHOLE_BYTES, clock()

    def start(self) -> None:
        """Begin the first part."""
        self.writer.write(self._begin)

    def write(self, result: FrameResult, /) -> None:
        """Hand over the line of a frame."""
        if TRACKS in KEPT[self.config.keep] and self._allows():
            text = frame_line(result)
            self._allowed_bytes -= len(text)
            self.writer.write(lambda: self._append(TRACKS, text))

    def ledger(self, record: dict[str, Any]) -> None:
        """Hand over a line of the ledger."""
        if LEDGER in KEPT[self.config.keep]:
            text = line(record)
            self.writer.write(lambda: self._append(LEDGER, text))

    def follow(self, config: RecordingConfig) -> None:
        """Follow the recording of another profile, and describe that profile in run.yaml."""
        self.config = config
        self.writer.write(self._redescribe)

    def health(self) -> dict[str, Any]:
        """Counts for status and summary."""
        counts = {
            "lines": self.lines,
            "lost_lines": self.lost + int(self.writer.health()["dropped"]),
            "thinned_lines": self.thinned,
            "pauses": self.pauses,
            "parts": self.parts,
        }
        return {"keep": self.config.keep, **counts, "failing": self.cause}

    def state(self, status: str) -> None:
        """Write the status beside the records or in memory, and make the lines so far survive a power cut."""
        self._check_files()
        self.sync()
        if self._ready() or self._begun:
            with suppress(ModtError):
                self.directory.write(STATUS, status)
                self.directory.in_memory(None)
                return
        self.directory.in_memory(status)

    def sync(self) -> None:
        """Make the lines so far survive a power cut. If that fails, they count as lost."""
        if self.cause is None and self._unsynced:
            if not self._attempt(self._sync):
                self.lost += self._unsynced
                self._close_files()
            self._unsynced = 0

    def finish(self) -> None:
        """Close the files."""
        self._check_files()
        self.sync()
        self._close_files()

    def _allows(self) -> bool:
        """Whether another frame keeps to `gb_per_day`."""
        now_s, self._allowed_s = self._allowed_s, self._clock()
        self._allowed_bytes += 1e9 * self.config.gb_per_day / DAY_S * max(self._allowed_s - now_s, 0.0)
        self._allowed_bytes = min(self._allowed_bytes, WHOLE_BYTES)
        self.thinned += self._allowed_bytes < 0
        return self._allowed_bytes >= 0

    def _append(self, name: str, text: str) -> None:
        if self._begun and self._bytes + len(text) > 1e6 * self.config.disk_mb / PARTS:
            self.finish()
        if not self._ready() or not self._attempt(lambda: self._line(name, text)):
            self.lost += 1
            return
        self.lines, self._bytes = self.lines + 1, self._bytes + len(text)
        self._unsynced += 1

    def _ready(self) -> bool:
        """Whether a part is open, or can be begun now."""
        if self.cause is not None and self._clock() < self._retry_s:
            return False
        if not self._begun:
            self._begin()
        return self._begun

    def _begin(self) -> None:
        limit_bytes = 1e6 * self.config.disk_mb * (1 - 1 / PARTS)
        self._begun = self._attempt(lambda: self.directory.begin(self._describe(), limit_bytes))
        self._bytes, self.parts = RESERVED_BYTES, self.parts + self._begun

    def _check_files(self) -> None:
        """Close a part whose files were moved or removed. The lines of removed files count as lost."""
        if self._begun and not (self.directory.present() and all(file.present() for file in self._files.values())):
            removed = sum(int(file.health()["written"]) for file in self._files.values() if file.removed())
            self.lost, self._unsynced = self.lost + removed, 0
            log.warning("%s: records were removed or moved; %d lines are lost", self.directory.path, removed)
            self._close_files()

    def _close_files(self) -> None:
        files, self._files, self._named, self._begun = self._files, {}, 0, False
        for file in files.values():
            with suppress(ModtError):
                file.close()

    def _redescribe(self) -> None:
        if self._begun:
            self._attempt(lambda: self.directory.write(RUN, self._describe(), lasting=True))

    def _line(self, name: str, text: str) -> None:
        if name not in self._files:
            self._files[name] = LineFile(self.directory.path / name, mode="ab")
        self._files[name].write(text)

    def _sync(self) -> None:
        for file in self._files.values():
            file.sync()
        if self._named != len(self._files):
            self.directory.sync()
            self._named = len(self._files)

    def _attempt(self, action: Callable[[], None]) -> bool:
        """Whether an action succeeded. A failure pauses the recording, and its end is logged."""
        try:
            action()
        except Exception as error:
            cause = error.cause if isinstance(error, ModtError) else f"{type(error).__name__}: {error}"
            if self.cause is None:
                self.pauses += 1
                subject = error.subject if isinstance(error, ModtError) else self.directory.path
                log.warning("%s: %s; recording pauses until it can", subject, cause)
            self.cause = cause
            self._retry_s = self._clock() + RETRY_S
            return False
        if self.cause is not None:
            log.warning("%s: recording again; %d lines are lost", self.directory.path, self.lost)
            self.cause = None
        return True


class WholeRecording(Recording):
    """All records of a replay, in one part and written at once. A failure ends the run.

    Args:
        directory, describe: as in Recording.
        sequence, camera: sequence and camera of the KITTI results.
        labels: whether point labels are written.
    """

    def __init__(
        self,
        directory: RunDirectory,
        describe: Callable[[], str],
        sequence: int,
        camera: Camera | None,
        *,
        labels: bool,
    ) -> None:
        more_than_a_disk_has = RecordingConfig(disk_mb=1e7, gb_per_day=1e5)
        super().__init__(directory, more_than_a_disk_has, AtOnce(), describe)
        self._sequence, self._camera, self._labels = sequence, camera, labels
        self._more: list[Writer[FrameResult]] = []

    def start(self) -> None:
        """Begin the files."""
        super().start()
        path = self.directory.path
        self._more.append(KittiResults(path / "kitti" / f"{self._sequence:04d}.txt", self._camera))
        if self._labels:
            self._more.append(PointLabels(path / "labels"))

    def write(self, result: FrameResult, /) -> None:
        """Write a frame."""
        super().write(result)
        for writer in self._more:
            writer.write(result)

    def follow(self, config: RecordingConfig) -> None:
        """Describe another profile, and keep the same records."""
        super().follow(self.config)

    def finish(self) -> None:
        """Close the files."""
        super().finish()
        for writer in self._more:
            writer.close()

    def _attempt(self, action: Callable[[], None]) -> bool:
        action()
        return True
