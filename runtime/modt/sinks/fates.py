"""Fates of the lines of a file: what was given is written, waits, or is missing for one reason."""

from __future__ import annotations

import threading

WAITING = "waiting"
WRITTEN = "written"
NOT_KEPT = "not_kept"
"""Left out by the profile."""
THINNED = "thinned"
"""Left out to keep to `recording.gb_per_day`."""
NOT_ENCODED = "not_encoded"
"""It has a number that no line can hold."""
DROPPED = "dropped"
"""The queue was full, or the end of the run did not wait for it."""
FAILED = "failed"
"""The disk could not be written."""
REMOVED = "removed"
"""Its file was removed."""
NOT_SYNCED = "not_synced"
"""It may be missing after a power cut, as the disk refused to sync."""
HELD = "held"
"""The disk hung with it when the run ended."""
LOST = (NOT_ENCODED, DROPPED, FAILED, REMOVED, NOT_SYNCED, HELD)
FATES = (WRITTEN, WAITING, NOT_KEPT, THINNED, *LOST)


class Fates:
    """Counts lines by their fate.

    A line has one fate from the moment it is given, and only `move` changes it. So the sum over all fates is the
    number of lines given, at any time, and after `end` no line waits. The loop and a writer move lines.
    """

    def __init__(self) -> None:
        self._count = dict.fromkeys(FATES, 0)
        self._changing = threading.Lock()
        self._ended = False

    def give(self, fate: str = WAITING) -> None:
        """Count another line."""
        with self._changing:
            self._count[fate] += 1

    def move(self, before: str, after: str, n: int = 1) -> None:
        """Give n lines another fate. After the end, a hanging disk that writes a line at last changes nothing."""
        with self._changing:
            if self._ended and before == WAITING:
                return
            assert self._count[before] >= n
            self._count[before] -= n
            self._count[after] += n

    def end(self) -> None:
        """Move the lines that wait to those held. From now on no line waits."""
        with self._changing:
            self._count[HELD] += self._count[WAITING]
            self._count[WAITING] = 0
            self._ended = True

    def counts(self) -> dict[str, int]:
        """Number of lines of each fate that a line has; `written` and `waiting` are always among them."""
        with self._changing:
            return {fate: n for fate, n in self._count.items() if n or fate in (WRITTEN, WAITING)}

    def sum(self, *fates: str) -> int:
        """Number of lines of some fates."""
        with self._changing:
            return sum(self._count[fate] for fate in fates)
