"""Check of the stamps of a source against the arrivals of its messages."""

from __future__ import annotations

from collections.abc import Sequence

from modt.errors import ScanError
from modt.sources.scan_file import sanitised
from modt.sources.stream import Faults, Sweep
from modt.types import Frame

STEP_S = 1.0
"""Time by which a stamp may differ from the arrivals [s]; a stamp beyond it, or before the last one, is doubted."""
DOUBT_S = 0.5
"""Time for which doubtful stamps are refused [s]. If they keep coming, a clock was set, and they are followed."""
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
        self.steps, self.shift_s, self.passed_s, self.waited_s = 0, 0.0, 0.0, 0.0
        self._last, self._before_s, self._live = last, last[1] if last else 0.0, live
        self._step_s = FIRST_STEP_S
        self._doubted_s: float | None = None  # time since the first doubtful stamp

    @property
    def doubting(self) -> bool:
        """Whether the latest message was refused."""
        return self._doubted_s is not None

    def doubt(self, stamp_s: float, arrived_s: float) -> str:
        """Reason why a stamp is refused; empty if it is accepted. The clock of the arrivals may be set as well."""
        since_s, self._before_s = arrived_s - self._before_s, arrived_s
        if self._last is None:
            self._last, self.passed_s, self.waited_s = (stamp_s, arrived_s), stamp_s, stamp_s
            return ""
        passed_s, waited_s = self.passed_s, self.waited_s = stamp_s - self._last[0], arrived_s - self._last[1]
        late = passed_s > 0 and waited_s - passed_s > STEP_S
        if 0 <= passed_s <= max(waited_s, 0.0) + STEP_S and not (self._live and (late or passed_s == 0)):
            self._step_s = passed_s or self._step_s
        else:
            since_s = since_s if since_s > 0 else self._step_s
            self._doubted_s = 0.0 if self._doubted_s is None else self._doubted_s + since_s
            both_set = waited_s < 0 and abs(passed_s - waited_s) <= STEP_S
            if self._doubted_s < DOUBT_S and not both_set:
                cause = f"stamped {abs(passed_s):.3f} s {'before' if passed_s < 0 else 'after'} the last sweep"
                arrival = f", which arrived {waited_s:.3f} s ago" if self._live else ""
                return cause + arrival + (": this process, the sender or the network was stopped" if late else "")
            self.steps += 1
            self.shift_s += max(waited_s, self._step_s) - passed_s
        self._last, self._doubted_s = (stamp_s, arrived_s), None
        return ""

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
        steps, cause = self.steps, self.doubt(sweep.stamp_s, arrived_s)
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
        stamp_s = sweep.stamp_s + self.shift_s - began_s
        return Frame(index, stamp_s, points, turn_s=sweep.turn_s)
