"""Records of a service: written by a thread of their own, in parts of limited size."""

from __future__ import annotations

import logging
import time
from collections.abc import Callable
from typing import Any

from modt.config import RecordingConfig
from modt.errors import ModtError
from modt.sinks.job_thread import JobThread
from modt.sinks.output import LineFile
from modt.sinks.records import line
from modt.sinks.run_directory import LEDGER, RUN, TRACKS
from modt.sinks.service_directory import ServiceDirectory
from modt.sinks.tracks import frame_line
from modt.types import FrameResult

log = logging.getLogger(__name__)

KEPT = {"all": (TRACKS, LEDGER), "tracks": (TRACKS,), "ledger": (LEDGER,), "none": ()}
PARTS = 8
"""The disk holds this many parts."""
RESERVED_BYTES = 20_000
"""Of a part, for run.yaml, status.json and summary.json."""
RETRY_S = 2.0
"""Between attempts to write again after a failure."""


class Recording:
    """tracks.jsonl and ledger.jsonl; while they cannot be written, lines are lost, counted, and the loop goes on.

    Args:
        directory: where they go.
        config: what is kept.
        writer: the thread that writes; `write` and `ledger` are called by the loop, all else by that thread.
        describe: text of run.yaml for a new part.
    """

    def __init__(
        self,
        directory: ServiceDirectory,
        config: RecordingConfig,
        writer: JobThread,
        describe: Callable[[], str],
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self.directory, self.config = directory, config
        self.lines = self.lost = self.pauses = self.parts = 0
        self._refused = 0  # lines, counted by the loop; all others by the writing thread
        self.cause: str | None = None  # why nothing can be written now
        self._writer, self._describe, self._clock = writer, describe, clock
        self._files: dict[str, LineFile[str]] = {}
        self._begun, self._bytes, self._retry_s = False, 0, float("-inf")
        self._synced, self._named = 0, 0  # lines, and files, that outlast a power cut
        writer.submit(self._begin)

    def write(self, result: FrameResult) -> None:
        """Hand over the line of a frame."""
        if TRACKS in KEPT[self.config.keep]:
            self._submit(TRACKS, frame_line(result))

    def ledger(self, record: dict[str, Any]) -> None:
        """Hand over a line of the ledger."""
        if LEDGER in KEPT[self.config.keep]:
            self._submit(LEDGER, line(record))

    def follow(self, config: RecordingConfig) -> None:
        """Keep what another profile says, and describe it."""
        self.config = config
        self._writer.submit(self._redescribe)

    def health(self) -> dict[str, Any]:
        """Counts for status and summary."""
        counts = {
            "lines": self.lines,
            "lost_lines": self.lost + self._refused,
            "pauses": self.pauses,
            "parts": self.parts,
        }
        return {"keep": self.config.keep, **counts, "failing": self.cause}

    def close(self) -> None:
        """No effect: `finish` ends the files on their own thread."""

    def sync(self) -> None:
        """Have the lines so far outlast a power cut; once a second."""
        if self.cause is None and self._synced != self.lines and self._attempt(self._sync):
            self._synced = self.lines

    def finish(self) -> None:
        """Close the files."""
        self.sync()
        files, self._files, self._named = self._files, {}, 0
        for file in files.values():
            file.close()

    def _submit(self, name: str, text: str) -> None:
        if not self._writer.submit(lambda: self._append(name, text)):
            self._refused += 1

    def _append(self, name: str, text: str) -> None:
        if self.cause is not None and self._clock() < self._retry_s:
            self.lost += 1
            return
        limit_bytes = 1e6 * self.config.disk_mb / PARTS
        if self._begun and self._bytes + len(text) > limit_bytes:
            self.finish()
            self._begun = False
        if not self._begun:
            self._begin()
        if not self._begun or not self._attempt(lambda: self._line(name, text)):
            self.lost += 1
            return
        self.lines, self._bytes = self.lines + 1, self._bytes + len(text)

    def _begin(self) -> None:
        limit_bytes = 1e6 * self.config.disk_mb * (1 - 1 / PARTS)
        self._begun = self._attempt(lambda: self.directory.begin(self._describe(), limit_bytes))
        self._bytes, self.parts = RESERVED_BYTES, self.parts + self._begun

    def _redescribe(self) -> None:
        if self._begun:
            self._attempt(lambda: self.directory.write(RUN, self._describe(), lasting=True))

    def _line(self, name: str, text: str) -> None:
        if name not in self._files:
            self._files[name] = LineFile(self.directory.path / name)
        self._files[name].write(text)

    def _sync(self) -> None:
        for file in self._files.values():
            file.sync()
        if self._named != len(self._files):
            self.directory.sync()
            self._named = len(self._files)

    def _attempt(self, action: Callable[[], None]) -> bool:
        """Whether an action went well; failures pause the recording, and its return is logged."""
        try:
            action()
        except ModtError as error:
            if self.cause is None:
                self.pauses += 1
                log.warning("%s: %s; recording pauses until it can", error.subject, error.cause)
            self.cause, self._retry_s = error.cause, self._clock() + RETRY_S
            return False
        if self.cause is not None:
            log.warning("%s: recording again; %d lines are lost", self.directory.path, self.lost)
            self.cause = None
        return True
