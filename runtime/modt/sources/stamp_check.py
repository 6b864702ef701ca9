"""The rule by which stamps of a source are believed: its time passes as that of the arrivals does."""

from __future__ import annotations

STEP_S = 1.0
"""Time by which a stamp may differ from the arrivals [s]; beyond it, or before the last stamp, it is doubted."""
DOUBT_S = 0.5
"""Time for which doubtful stamps are refused [s]. If they keep coming, a clock was set, and they are followed."""
FIRST_STEP_S = 0.1
"""Time between two messages until two are believed [s]."""
CLOCK_SET = "a clock was set: stamps go on evenly"
"""Fault of a frame from which on other stamps are followed."""


class StampCheck:
    """Refuses single stamps that lie and follows a clock that was set: the rule of recordings and live sources.

    Attributes:
        steps: number of times that a clock was set.
        shift_s: time to add to a stamp, so that stamps go on evenly where a clock was set [s].
        passed_s, waited_s: time from the last believed message to the latest one, by stamps and by arrivals [s].
    """

    def __init__(self, last: tuple[float, float] | None = None, *, live: bool = False) -> None:
        """Begin a source.

        Args:
            last: stamp and arrival of a message that is believed.
            live: a stamp that repeats or is late is of no use either; a recording may hold messages that waited.
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
        """Why a stamp is refused; empty if it is believed. The clock of the arrivals may be set as well."""
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
