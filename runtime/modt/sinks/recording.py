"""Records of a run. Those of a service are written by a thread of their own, in parts of limited size."""

from __future__ import annotations

import logging
import time
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass
from typing import TYPE_CHECKING

from modt.config import RecordingConfig
from modt.energy.ledger import LedgerLine
from modt.energy.windows import EnergyWindow
from modt.errors import ModtError
from modt.geometry import Camera
from modt.sinks.fates import (
    DROPPED,
    FAILED,
    LOST,
    NOT_ENCODED,
    NOT_KEPT,
    NOT_SYNCED,
    REMOVED,
    THINNED,
    WAITING,
    WRITTEN,
    Fates,
)
from modt.sinks.kitti import KittiResults, PointLabels
from modt.sinks.output import Health, LineFile, Writer
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
STATUS_LATE_S = 2.5
"""Age of the status beside the records from which on it is kept in memory [s]."""
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


@dataclass(frozen=True)
class RecordingHealth:
    """Counts of a recording, for status and summary."""

    keep: str  # as in the configuration
    fates: Mapping[str, int]  # number of frames by the fate of their line (`modt.sinks.fates`)
    lines: int  # written, of all files
    lost_lines: int  # not written, or perhaps missing since their file was removed or not synced
    thinned_lines: int  # left out to keep to `gb_per_day`
    pauses: int  # how often writing failed
    parts: int  # begun
    failing: str | None  # why nothing can be written now


@dataclass(frozen=True)
class LineJob:
    """Job that appends a line to a file of a recording."""

    recording: Recording
    name: str
    text: str

    def __call__(self) -> None:
        """Append it."""
        self.recording.append(self.name, self.text)


def count_dropped(job: Job) -> None:
    """Count the line of a job that a full queue drops. The other jobs come again."""
    if isinstance(job, LineJob):
        job.recording.fates[job.name].move(WAITING, DROPPED)


class Recording(Writer[FrameResult]):
    """tracks.jsonl and ledger.jsonl. While they cannot be written, lines are lost and counted.

    Every line that is handed over has one fate at any time, and none waits after `end`.

    Once a second it checks that its files are in place, and begins another part if they were removed or moved.

    Args:
        directory: directory of the records.
        config: choice of the records and their limits.
        writer: runs what writes, in a thread; `write`, `ledger`, `start` and `configure` are for the loop, the rest
            for that thread. One that drops jobs calls `count_dropped`.
        describe: text of run.yaml for a new part.

    Attributes:
        fates: fates of the lines of each file.
    """

    def __init__(
        self,
        directory: RunDirectory,
        config: RecordingConfig,
        writer: Background[Job] | AtOnce,
        describe: Callable[[], str],
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self.directory = directory
        self.config = config
        self.writer = writer
        self._describe = describe
        self._clock = clock
        self.fates = {TRACKS: Fates(), LEDGER: Fates()}
        # Counts, as in RecordingHealth
        self._pauses = 0
        self._parts = 0
        self._failing: str | None = None
        self._status_s = float("-inf")  # time at which the status was last written beside the records
        self._status_failed = True  # it is not there
        # The present part
        self._begun = False
        self._files: dict[str, LineFile[str]] = {}
        self._bytes = 0
        self._unsynced = dict.fromkeys(self.fates, 0)  # lines of each file that a power cut may take
        self._synced_files = 0  # files whose names survive a power cut
        self._retry_s = float("-inf")  # time of the next attempt after a failure
        # A token bucket: what may be written of the tracks, and when it was last filled
        self._allowed_bytes = WHOLE_BYTES
        self._filled_s = clock()

    def start(self) -> None:
        """Begin the first part."""
        self.writer.write(self._begin)

    def write(self, result: FrameResult, /) -> None:
        """Hand over the line of a frame.

        Raises:
            ValueError: the line has a number that is not finite. It counts as lost.
        """
        fates = self.fates[TRACKS]
        if TRACKS not in KEPT[self.config.keep]:
            fates.give(NOT_KEPT)
        elif not self._allows():
            fates.give(THINNED)
        else:
            try:
                text = frame_line(result)
            except ValueError:
                fates.give(NOT_ENCODED)
                raise
            self._allowed_bytes -= len(text)
            self._hand_over(TRACKS, text)

    def ledger(self, costs: LedgerLine | EnergyWindow, /) -> None:
        """Hand over a line of the ledger."""
        if LEDGER in KEPT[self.config.keep]:
            self._hand_over(LEDGER, line(costs))

    def _hand_over(self, name: str, text: str) -> None:
        self.fates[name].give()
        self.writer.write(LineJob(self, name, text))

    def configure(self, config: RecordingConfig) -> None:
        """Record as another profile says, and describe that profile in run.yaml."""
        self.config = config
        self.writer.write(self.redescribe)

    def health(self) -> RecordingHealth:
        """Counts so far."""
        return RecordingHealth(
            keep=self.config.keep,
            fates=self.fates[TRACKS].counts(),
            lines=self._sum(WRITTEN),
            lost_lines=self._sum(*LOST),
            thinned_lines=self._sum(THINNED),
            pauses=self._pauses,
            parts=self._parts,
            failing=self._failing,
        )

    def write_status(self, status: str) -> None:
        """Write the status beside the records, and make the lines so far survive a power cut."""
        self._check_files()
        self.sync()
        self._status_failed = not (self._ready() or self._begun) or not self._wrote(status)
        if not self._status_failed:
            self._status_s = self._clock()

    def _wrote(self, status: str) -> bool:
        """Write the status beside the records; returns whether that succeeded."""
        try:
            self.directory.write(STATUS, status)
        except ModtError:
            return False
        return True

    def keep_status(self, status: str) -> None:
        """Keep the status in memory while it cannot be written beside the records, or a disk that hangs delays it.

        It is called by another thread than that of the writer.
        """
        hangs = self._clock() - self._status_s > STATUS_LATE_S
        self.directory.in_memory(status if hangs or self._status_failed else None)

    def end(self, documents: Callable[[RecordingHealth], Mapping[str, str]]) -> None:
        """Close the files after all lines, then write documents beside them, and end the writer's thread.

        The thread makes the documents, by their names, from the final counts. What it has not done within its time
        is left out, and counts as lost.
        """
        self.writer.write(self.redescribe)
        self.writer.write(self.finish)
        self.writer.write(lambda: self._write_last(documents))
        self.writer.close()
        for fates in self.fates.values():
            fates.end()

    def _write_last(self, documents: Callable[[RecordingHealth], Mapping[str, str]]) -> None:
        """Write the last documents, if any part could be begun."""
        if self._parts:
            for name, text in documents(self.health()).items():
                self.directory.write(name, text)

    def sync(self) -> None:
        """Make the lines so far survive a power cut. If that fails, they count as lost."""
        if self._failing is None and any(self._unsynced.values()):
            if not self._attempt(self._sync):
                for name, n in self._unsynced.items():
                    self.fates[name].move(WRITTEN, NOT_SYNCED, n)
                self._close_files()
            self._unsynced = dict.fromkeys(self.fates, 0)

    def finish(self) -> None:
        """Close the files."""
        self._check_files()
        self.sync()
        self._close_files()

    def _allows(self) -> bool:
        """Whether another frame keeps to `gb_per_day`."""
        now_s = self._clock()
        filled_bytes = 1e9 * self.config.gb_per_day / DAY_S * max(now_s - self._filled_s, 0.0)
        self._filled_s = now_s
        self._allowed_bytes = min(self._allowed_bytes + filled_bytes, WHOLE_BYTES)
        return self._allowed_bytes >= 0

    def _sum(self, *fates: str) -> int:
        return sum(of_file.sum(*fates) for of_file in self.fates.values())

    def append(self, name: str, text: str) -> None:
        """Append a line to the present part, or to another one where it is full. A line that fails is lost."""
        if self._begun and self._bytes + len(text) > 1e6 * self.config.disk_mb / PARTS:
            self.finish()
        if not self._ready() or not self._attempt(lambda: self._line(name, text)):
            self.fates[name].move(WAITING, FAILED)
            return
        self.fates[name].move(WAITING, WRITTEN)
        self._unsynced[name] += 1
        self._bytes += len(text)

    def _ready(self) -> bool:
        """Whether a part is open, or can be begun now."""
        if self._failing is not None and self._clock() < self._retry_s:
            return False
        if not self._begun:
            self._begin()
        return self._begun

    def _begin(self) -> None:
        limit_bytes = 1e6 * self.config.disk_mb * (1 - 1 / PARTS)
        self._begun = self._attempt(lambda: self.directory.begin(self._describe(), limit_bytes))
        self._parts += self._begun
        self._bytes = RESERVED_BYTES

    def _check_files(self) -> None:
        """Close a part whose files were moved or removed. The lines of removed files count as lost."""
        if self._begun and not (self.directory.present() and all(file.present() for file in self._files.values())):
            removed = {name: int(f.health()["written"]) for name, f in self._files.items() if f.removed()}
            for name, n in removed.items():
                self.fates[name].move(WRITTEN, REMOVED, n)
            self._unsynced = dict.fromkeys(self.fates, 0)
            n_lost = sum(removed.values())
            log.warning("%s: records were removed or moved; %d lines are lost", self.directory.path, n_lost)
            self._close_files()

    def _close_files(self) -> None:
        """End the present part. The next line begins another."""
        files = self._files
        self._files = {}
        self._synced_files = 0
        self._begun = False
        for file in files.values():
            with suppress(ModtError):
                file.close()

    def redescribe(self) -> None:
        """Write run.yaml anew."""
        if self._begun:
            self._attempt(lambda: self.directory.write(RUN, self._describe(), lasting=True))

    def _line(self, name: str, text: str) -> None:
        if name not in self._files:
            self._files[name] = LineFile(self.directory.path / name, mode="ab")
        self._files[name].write(text)

    def _sync(self) -> None:
        for file in self._files.values():
            file.sync()
        if self._synced_files != len(self._files):
            self.directory.sync()
            self._synced_files = len(self._files)

    def _attempt(self, action: Callable[[], None]) -> bool:
        """Whether an action succeeded. A failure pauses the recording, and its end is logged."""
        try:
            action()
        except Exception as error:
            cause = error.cause if isinstance(error, ModtError) else f"{type(error).__name__}: {error}"
            if self._failing is None:
                self._pauses += 1
                subject = error.subject if isinstance(error, ModtError) else self.directory.path
                log.warning("%s: %s; recording pauses until it can", subject, cause)
            self._failing = cause
            self._retry_s = self._clock() + RETRY_S
            return False
        if self._failing is not None:
            log.warning("%s: recording again; %d lines are lost", self.directory.path, self._sum(*LOST))
            self._failing = None
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
        self._sequence = sequence
        self._camera = camera
        self._labels = labels
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

    def configure(self, config: RecordingConfig) -> None:
        """Describe another profile, and keep the same records."""
        super().configure(self.config)

    def finish(self) -> None:
        """Close the files."""
        super().finish()
        for writer in self._more:
            writer.close()

    def _attempt(self, action: Callable[[], None]) -> bool:
        action()
        return True
