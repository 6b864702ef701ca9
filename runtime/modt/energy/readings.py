"""The rule that turns the readings of a meter into joules, for counters and power samples alike.

An interval is measured if the readings at both its ends are accepted. Any other interval is marked with its cause. A
reading is accepted if the power that it implies lies near the power that the meter has shown, counted from the last
accepted reading, or near the power that the doubtful reading before it implied.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from modt.energy.meters.meter import Facts, Kind

SURGE = 4.0
"""A reading is accepted at once up to this factor beyond the lowest and the highest power shown."""
TICK_S = 0.01
"""Greatest time between two steps of a counter [s]."""


@dataclass(frozen=True)
class History:
    """State of a meter by which its next reading is judged."""

    accepted: bool = False  # whether the last reading is accepted
    base: float | None = None  # last accepted reading
    base_s: float = 0.0  # time since that reading
    doubtful: float | None = None  # last reading, while it is doubtful
    doubtful_s: float = 0.0  # time for which the meter had stood still before it
    doubtful_W: float | None = None  # power that it implies
    low_W: float = math.inf  # lowest power measured
    high_W: float = -math.inf  # highest power measured


@dataclass(frozen=True)
class _Step:
    """Change between two readings: its energy, bounds of its power, and its fault."""

    start: float | None  # the first of the two readings
    joules: float
    watts: float | None  # None where the interval is too short to tell
    least_W: float
    most_W: float
    fault: str
    mark: str = ""

    def near(self, low_W: float, high_W: float) -> bool:
        """Whether the power lies within SURGE of a range."""
        return not self.fault and low_W / SURGE <= self.most_W and self.least_W <= SURGE * high_W


Judgement = tuple[History, float | None, str]
"""The history after a reading, the energy of the interval up to it [J], None where not measured, and its mark."""


def judge(facts: Facts, before: History, reading: float | None, seconds: float) -> Judgement:
    """Judge a reading, `seconds` after the one before.

    Marks: "wrap" (measured; a counter passed its range); without energy "first" (nothing to compare with), "lost"
    (unreadable or out of range), "back" (the reading before was lost or doubtful), "implausible" (unlike what the
    meter has shown), "reset" (counter decreased), "negative" (power below zero), "stuck" (nothing is drawn),
    "ambiguous" (long enough for a full range of the counter).
    """
    unsettled = replace(
        before, accepted=False, base_s=before.base_s + seconds, doubtful=None, doubtful_s=0.0, doubtful_W=None
    )
    if reading is None or not _in_range(facts, reading):
        return unsettled, None, "lost"
    if facts.kind is Kind.ESTIMATED:  # computed by a formula, which is never wrong
        return History(True, reading), None if before.base is None else reading - before.base, ""
    from_base = _step(facts, before, before.base, reading, unsettled.base_s)
    step = from_base
    if before.doubtful is not None:
        step = _step(facts, before, before.doubtful, reading, before.doubtful_s + seconds)
    # It may continue the accepted reading, unless the meter stands still since then.
    if step.fault != "stuck" and from_base.near(before.low_W, before.high_W):
        return _accept(facts, before, from_base, reading, seconds, measured=before.accepted)
    # It may continue the doubtful reading instead, by the power that either that one or the meter before has shown.
    if before.doubtful is not None:
        doubtful_W = before.doubtful_W
        agrees = doubtful_W is not None and not step.mark and step.near(doubtful_W, doubtful_W)
        if agrees or step.near(before.low_W, before.high_W):
            stood_still = before.doubtful_s > 0
            agreed_W = doubtful_W if agrees else None
            return _accept(facts, before, step, reading, seconds, measured=not stood_still, agreed_W=agreed_W)
    mark = step.fault or ("first" if before.base is None else "implausible")
    stood_still_s = before.doubtful_s + seconds if mark == "stuck" else 0.0
    doubt = replace(unsettled, doubtful=reading, doubtful_s=stood_still_s, doubtful_W=step.watts)
    return doubt, None, mark


def _in_range(facts: Facts, reading: float) -> bool:
    """Whether a meter can show the reading."""
    return math.isfinite(reading) and (not facts.counts or 0 <= reading <= (facts.wrap_J or reading))


def _accept(
    facts: Facts,
    before: History,
    step: _Step,
    reading: float,
    seconds: float,
    *,
    measured: bool,
    agreed_W: float | None = None,
) -> Judgement:
    """Accept a reading. Its power, and that of the doubtful reading with which it agrees, count as shown."""
    if not measured:
        return History(True, reading, low_W=before.low_W, high_W=before.high_W), None, "back"
    shown_W = [watts for watts in (step.watts, agreed_W) if watts is not None]
    low_W = min([before.low_W, *shown_W])
    high_W = max([before.high_W, *shown_W])
    # Power samples are integrated by the trapezoidal rule.
    joules = step.joules if facts.counts else 0.5 * seconds * (max(step.start or 0.0, 0.0) + reading)
    return History(True, reading, low_W=low_W, high_W=high_W), max(joules, 0.0), step.mark


def _step(facts: Facts, before: History, start: float | None, end: float, seconds: float) -> _Step:
    """Change from one reading to another. A power sample stands alone."""
    if not facts.counts:
        return _power_step(facts, start, end)
    if start is None:
        return _Step(start, 0.0, None, 0.0, 0.0, "first")
    joules = end - start
    mark = ""
    if joules < 0 and facts.wrap_J:
        joules += facts.wrap_J
        mark = "wrap"
    # Each reading may be as old as a step of the counter.
    least_W = (joules - facts.resolution) / (seconds + TICK_S)
    most_W = (joules + facts.resolution) / (seconds - TICK_S) if seconds > TICK_S else math.inf
    known_W = SURGE * before.high_W if before.base is not None else math.inf
    fault = ""
    # A wrap that implies another power than was shown may as well be a reset.
    if joules < -facts.resolution or (mark and not (before.low_W <= most_W and least_W <= before.high_W)):
        fault = "reset"
    elif seconds * min(facts.max_W, known_W) >= (facts.wrap_J or math.inf):
        fault = "ambiguous"
    elif joules <= 0 and seconds > 10 * TICK_S and facts.must_draw:
        fault = "stuck"
    elif least_W > facts.max_W:
        fault = "implausible"
    watts = joules / seconds if seconds > 2 * TICK_S and not fault and not mark else None
    return _Step(start, joules, watts, least_W, most_W, fault, mark)


def _power_step(facts: Facts, start: float | None, watts: float) -> _Step:
    """A power sample as the joules of a second."""
    fault = ""
    if watts < -facts.resolution:
        fault = "negative"
    elif watts <= 0 and facts.must_draw:
        fault = "stuck"
    elif watts - facts.resolution > facts.max_W:
        fault = "implausible"
    bounds_W = (watts - facts.resolution, watts + facts.resolution)
    return _Step(start, watts, None if fault else watts, *bounds_W, fault)
