"""The one rule that turns readings of a meter into joules, for counters and power samples alike.

An interval is measured when the readings at both its ends are confirmed; any other one is marked with its cause.
A reading is confirmed by the power that it implies: near what the meter has shown, counted from the last confirmed
reading, or near what the doubtful reading before it implied. Only so does a doubtful reading become a base.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from enum import Enum
from functools import partial

from modt.energy.meters.meter import Facts, Kind, Measurand

SURGE = 4.0
"""Factor beyond the lowest and the highest power shown up to which a reading is confirmed at once."""
TICK_S = 0.01
"""Time between two steps of a counter, at most [s]."""


class Event(Enum):
    """Relation of a reading to those before."""

    FITS = "continues the confirmed reading, or one before a standstill"
    AGREES = "continues the doubtful reading"
    STRAYS = "continues neither"
    LOST = "there is none"


CONFIRMED, DOUBTED = True, False
TABLE = {
    (CONFIRMED, Event.FITS): (CONFIRMED, True),
    (CONFIRMED, Event.STRAYS): (DOUBTED, False),
    (CONFIRMED, Event.LOST): (DOUBTED, False),
    (DOUBTED, Event.FITS): (CONFIRMED, False),
    (DOUBTED, Event.AGREES): (CONFIRMED, True),
    (DOUBTED, Event.STRAYS): (DOUBTED, False),
    (DOUBTED, Event.LOST): (DOUBTED, False),
}
"""Whether the last reading is confirmed, by this and the event; and whether the interval up to it is measured."""


@dataclass(frozen=True, slots=True)
class History:
    """The readings so far, as far as the next one is judged by them."""

    state: bool = DOUBTED
    base: float | None = None  # last confirmed reading
    base_s: float = 0.0  # time since
    doubtful: float | None = None  # last reading, while it is doubted
    doubtful_s: float = 0.0  # time for which it had stood still before
    doubtful_W: float | None = None  # power that it implies
    low_W: float = math.inf  # lowest and highest power measured
    high_W: float = -math.inf


@dataclass(frozen=True, slots=True)
class _Step:
    """Change between two readings: its energy, the power that it implies within bounds, and what is wrong with it."""

    joules: float
    watts: float | None  # None where the interval is too short to tell
    least_W: float
    most_W: float
    fault: str
    mark: str = ""

    def near(self, low_W: float, high_W: float) -> bool:
        """Whether the power may lie in a range, or not far from it."""
        return not self.fault and low_W / SURGE <= self.most_W and self.least_W <= SURGE * high_W


def judge(facts: Facts, before: History, reading: float | None, seconds: float) -> tuple[History, float | None, str]:
    """The history after a reading, the energy of the interval up to it [J], None where not measured, and its mark.

    Marks: "wrap" (measured; a counter passed its range); without energy "first" (nothing to compare with), "lost"
    (unreadable or out of range), "back" (the reading before was lost or doubtful), "implausible" (unlike what the
    meter has shown), "reset" (counter decreased), "negative" (power below zero), "stuck" (nothing is drawn),
    "ambiguous" (long enough for a full range of the counter).
    """
    base_s, event, agrees = before.base_s + seconds, Event.STRAYS, False
    unsettled = partial(History, base=before.base, base_s=base_s, low_W=before.low_W, high_W=before.high_W)
    counts = facts.measurand is Measurand.ENERGY
    if reading is None or not math.isfinite(reading) or (counts and not 0 <= reading <= (facts.wrap_J or reading)):
        return unsettled(TABLE[before.state, Event.LOST][0]), None, "lost"
    if facts.kind is Kind.ESTIMATED:  # a formula
        return History(CONFIRMED, reading), None if before.base is None else reading - before.base, ""
    step = from_base = _step(facts, before, before.base, reading, base_s)
    if before.doubtful is not None:
        step = _step(facts, before, before.doubtful, reading, before.doubtful_s + seconds)
    if step.fault != "stuck" and from_base.near(before.low_W, before.high_W):
        step, event = from_base, Event.FITS
    elif before.doubtful is not None:
        watts = before.doubtful_W
        agrees = watts is not None and not step.mark and step.near(watts, watts)
        if agrees or step.near(before.low_W, before.high_W):
            event = Event.FITS if before.doubtful_s else Event.AGREES
    state, measured = TABLE[before.state, event]
    if state is DOUBTED:
        mark = step.fault or ("first" if before.base is None else "implausible")
        age_s = before.doubtful_s + seconds if mark == "stuck" else 0.0
        return unsettled(state, doubtful=reading, doubtful_s=age_s, doubtful_W=step.watts), None, mark
    after = History(state, reading, low_W=before.low_W, high_W=before.high_W)
    if not measured:
        return after, None, "back"
    shown = [watts for watts in (step.watts, before.doubtful_W if agrees else None) if watts is not None]
    after = replace(after, low_W=min([before.low_W, *shown]), high_W=max([before.high_W, *shown]))
    if counts:
        return after, max(step.joules, 0.0), step.mark
    start = before.base if event is Event.FITS else before.doubtful
    return after, 0.5 * seconds * (max(start or 0.0, 0.0) + max(reading, 0.0)), ""


def _step(facts: Facts, before: History, start: float | None, end: float, seconds: float) -> _Step:
    if facts.measurand is Measurand.POWER:
        fault = "stuck" if end <= 0 and facts.must_draw else "implausible" if end > facts.max_W else ""
        fault = "negative" if end < -facts.resolution else fault
        return _Step(0.0, None if fault else end, end - facts.resolution, end + facts.resolution, fault)
    if start is None:
        return _Step(0.0, None, 0.0, 0.0, "first")
    joules, wrap_J, mark, fault = end - start, facts.wrap_J or math.inf, "", ""
    if joules < 0 and facts.wrap_J is not None:
        joules, mark = joules + wrap_J, "wrap"
    least_W = (joules - facts.resolution) / (seconds + TICK_S)
    most_W = (joules + facts.resolution) / (seconds - TICK_S) if seconds > TICK_S else math.inf
    # A wrap beyond what was shown may as well be a reset.
    if joules < 0 or (mark and not (before.low_W <= most_W and least_W <= before.high_W)):
        fault = "reset"
    elif seconds * min(facts.max_W, SURGE * before.high_W if before.base is not None else math.inf) >= wrap_J:
        fault = "ambiguous"
    elif joules == 0 and seconds > 10 * TICK_S and facts.must_draw:
        fault = "stuck"
    elif least_W > facts.max_W:
        fault = "implausible"
    watts = joules / seconds if seconds > 2 * TICK_S and not fault and not mark else None
    return _Step(joules, watts, least_W, most_W, fault, mark)
