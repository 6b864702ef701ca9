"""Check of the stamps of a source against the arrivals of its messages."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from modt.errors import ScanError
from modt.sources.scan_file import sanitised
from modt.sources.stream import Faults, Sweep
from modt.types import Frame

STEP_S = 1.0
"""Time by which a stamp may differ from the arrivals [s]; a stamp beyond it, or before the last one, is doubted."""
DOUBT_S = 0.5
"""Time for which doubtful stamps are refused [s]. If they keep coming, a clock was set, and they are followed."""
REPEATED = "has the stamp of the last sweep: recorded twice?"
MAX_PAUSE_S = 86_400.0
"""Longest pause of a source [s]; after a longer one, by stamps and arrivals, the clock that they share was set."""
FIRST_STEP_S = 0.1
"""Assumed time between two messages until two are accepted [s]."""


class StampCheck:
    """Refuses single wrong stamps and follows a clock that was set, in recordings and live sources.

    Attributes:
        steps: number of times that a clock was set.
        shift_s: time to add to a stamp, so that stamps go on evenly where a clock was set [s].
        passed_s, waited_s: time from the last accepted message to the latest one, by stamps and by arrivals [s].
    """

    def __init__(self, last: tuple[float, float] | None = None, *, live: bool = False) -> None:
        """Begin a source.

        Args:
            last: stamp and arrival of a message that is accepted.
            live: refuse a stamp that repeats or is late too; a recording may hold messages that waited.
        """
        self.steps = 0
        self.shift_s = 0.0
        self.passed_s = 0.0
        self.waited_s = 0.0
        self._live = live
        self._last = last
        self._arrived_s = last[1] if last else 0.0  # arrival of the latest message
        self._step_s = FIRST_STEP_S
        self._doubted_s: float | None = None  # time since the first doubtful stamp
        self._framed = (np.nan, np.nan)  # stamp and arrival of the sweep that was the latest frame

    @property
    def doubting(self) -> bool:
        """Whether the latest message was refused."""
        return self._doubted_s is not None

    def doubt(self, stamp_s: float, arrived_s: float) -> str:
        """Reason why a stamp is refused; empty if it is accepted. The clock of the arrivals may be set as well."""
        since_s = arrived_s - self._arrived_s
        self._arrived_s = arrived_s
        if self._last is None:
            self.passed_s = stamp_s
            self.waited_s = stamp_s
        else:
            self.passed_s = stamp_s - self._last[0]
            self.waited_s = arrived_s - self._last[1]
            if self._continues():
                self._step_s = self.passed_s or self._step_s
            elif cause := self._refusal(since_s):
                return cause
            else:
                self.steps += 1
                waited_s = self._step_s if self.waited_s > MAX_PAUSE_S else self.waited_s
                self.shift_s += max(waited_s, self._step_s) - self.passed_s
        self._last = (stamp_s, arrived_s)
        self._doubted_s = None
        return ""

    @property
    def _late(self) -> bool:
        return self.passed_s > 0 and self.waited_s - self.passed_s > STEP_S

    def _continues(self) -> bool:
        """Whether the latest stamp fits its arrival."""
        if self._live and (self._late or self.passed_s == 0):
            return False
        return 0 <= self.passed_s <= min(max(self.waited_s, 0.0), MAX_PAUSE_S) + STEP_S

    def _refusal(self, since_s: float) -> str:
        """Reason to refuse a doubtful stamp `since_s` after the message before; empty if a clock was set."""
        if self._doubted_s is None:
            self._doubted_s = 0.0
        else:
            self._doubted_s += since_s if since_s > 0 else self._step_s
        impossible = self.waited_s < 0 or self.waited_s > MAX_PAUSE_S
        both_set = impossible and abs(self.passed_s - self.waited_s) <= STEP_S
        if both_set or self._doubted_s >= DOUBT_S:
            return ""
        order = "before" if self.passed_s < 0 else "after"
        arrival = f", which arrived {self.waited_s:.3f} s ago" if self._live else ""
        stopped = ": this process, the sender or the network was stopped" if self._late else ""
        return f"stamped {abs(self.passed_s):.3f} s {order} the last sweep{arrival}{stopped}"

    def frame(
        self,
        sweep: Sweep,
        arrived_s: float,
        index: int,
        subject: str,
        faults: Faults,
        flaws: Sequence[str] = (),
        began_s: float = 0.0,
    ) -> Frame | None:
        """Frame of a recorded sweep, stamped from `began_s` on; None if it cannot be used.

        Flaws and refusals of the `subject` are reported to `faults`.
        """
        steps = self.steps
        cause = self.doubt(sweep.stamp_s, arrived_s)
        framed_stamp_s, framed_s = self._framed
        if not cause and sweep.stamp_s == framed_stamp_s and arrived_s - framed_s < self._step_s / 2:
            cause = REPEATED
        if not cause:
            try:
                points, broken = sanitised(sweep.points, subject)
            except ScanError as error:
                cause = error.cause
        if cause:
            faults.report(index, subject, cause, skipped=True)
            return None
        flaws = [*broken, *flaws, *["a clock was set: stamps go on evenly"] * (self.steps > steps)]
        if flaws:
            faults.report(index, subject, "; ".join(flaws), skipped=False)
        self._framed = (sweep.stamp_s, arrived_s)
        stamp_s = sweep.stamp_s + self.shift_s - began_s
        return Frame(index, stamp_s, points, turn_s=sweep.turn_s, mid_rad=sweep.mid_rad, delay_s=sweep.delay_s)
