"""The rule that turns readings into joules, with faults of real meters and on a model that knows the truth."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from modt.energy.meters.meter import Facts, Kind, Scope
from modt.energy.readings import History, judge

RANGE_J = 65_532.610987


def facts(kind=Kind.MEASURED, wrap_J=RANGE_J, scope=Scope.CPU):
    return Facts(name="test", unit="J", resolution=61e-6, max_W=1000.0, scope=scope, kind=kind, wrap_J=wrap_J)


def judged(meter, readings, seconds=1.0):
    """Energy of each interval between readings a second apart, or why it has none; a mark follows its energy."""
    history = History()
    found = []
    for reading in readings:
        history, joules, mark = judge(meter, history, reading, seconds)
        energy = mark if joules is None else round(joules, 6)
        found.append((energy, mark) if mark and joules is not None else energy)
    return found[1:]


KNOWN = [1000.0, 1040.0, 1080.0]
"""Readings of a counter after which its power, 40 W, is known."""
NEAR = [RANGE_J - J for J in (100.0, 60.0, 20.0)]
"""Such readings just before the counter begins again."""


@pytest.mark.parametrize(
    ("readings", "found"),
    [
        ([*KNOWN, 1120.0, 1160.0], [40.0, 40.0]),
        ([*KNOWN, 0.0, 1160.0, 1200.0], ["reset", "back", 40.0]),
        ([*KNOWN, 9000.0, 1160.0, 1200.0], ["implausible", "back", 40.0]),
        ([*KNOWN, 1080.0, 1080.0, 1200.0, 1240.0], ["stuck", "stuck", "back", 40.0]),
        ([*KNOWN, None, 1160.0, 1200.0], ["lost", "back", 40.0]),
        ([*KNOWN, math.inf, math.nan, 1200.0], ["lost", "lost", "back"]),
        ([*KNOWN, 5.0, 45.0, 85.0], ["reset", 40.0, 40.0]),
        ([*KNOWN, 1380.0, 1680.0, 1690.0], ["implausible", 300.0, 10.0]),
        ([*KNOWN, 1380.0, 1380.0], ["implausible", "stuck"]),
        ([*KNOWN, 1082.0, 1085.0, 1088.0], ["implausible", 3.0, 3.0]),
        ([*KNOWN, 9000.0, 30_000.0, 1200.0], ["implausible", "implausible", "back"]),
        ([*KNOWN, -40.0, RANGE_J + 1, 1200.0], ["lost", "lost", "back"]),
        ([*NEAR, 20.0, 60.0], [(40.0, "wrap"), 40.0]),
        ([RANGE_J - 700.0, RANGE_J - 660.0, RANGE_J - 620.0, 0.0, 40.0], ["reset", 40.0]),
    ],
)
def test_faults_of_a_counter(readings, found):
    assert judged(facts(), readings)[2:] == found


@pytest.mark.parametrize(
    ("scope", "readings", "found"),
    [
        (Scope.SOC, [6.0, 6.4, 5.6], [6.2, 6.0]),
        (Scope.SOC, [6.0, 6.0, 450.0, 6.0, 6.0], [6.0, "implausible", "back", 6.0]),
        (Scope.SOC, [6.0, 6.0, 0.0, 6.0, 6.0], [6.0, "stuck", "back", 6.0]),
        (Scope.SOC, [6.0, 6.0, 0.02, 6.0, 6.0], [6.0, "implausible", "back", 6.0]),
        (Scope.SOC, [-6.0, -6.0, -6.0], ["negative", "negative"]),
        (Scope.SOC, [450.0, 6.0, 6.0], ["first", 6.0]),
        (Scope.SOC, [6.0, 6.0, 30.0, 31.0], [6.0, "implausible", 30.5]),
        (Scope.SOC, [6.0, 6.0, 1e300, 1e300], [6.0, "implausible", "implausible"]),
        # a rail may feed nothing now
        (Scope.RAIL, [0.0, 0.0, 0.0, 2.0, 2.0], [0.0, 0.0, "implausible", 2.0]),
    ],
)
def test_faults_of_a_power_sensor(scope, readings, found):
    assert judged(facts(Kind.INTEGRATED, None, scope), readings) == found


def test_a_counter_is_ambiguous_over_an_interval_in_which_it_may_go_round():
    meter = facts(wrap_J=200.0)
    assert judged(meter, [0.0, 10.0, 20.0, 30.0], seconds=0.1)[-1] == 10.0
    assert judged(meter, [0.0, 40.0, 80.0, 120.0], seconds=1.0)[-1] == "ambiguous"


def counted(random, energy_J):
    """Readings of a faulty counter, from the true energy of the interval before each.

    A fault is one that can be told: a value, alone among five, that no machine of several times the power reaches, a
    counter that stands still (and has, or has not, counted meanwhile), is gone, or begins anew far from its range.
    """
    most_J = 5 * float(energy_J.max())
    value_J = float(random.uniform(0, RANGE_J))
    held_J = None
    left = 0
    stalled = False
    rest = 0
    for true_J in energy_J.tolist():
        left = max(left - 1, 0)
        value_J = (value_J + true_J * (not (left and stalled))) % RANGE_J
        fault = random.choice(["none", "glitch", "stick", "gone", "reset"], p=[0.8, 0.08, 0.05, 0.05, 0.02])
        if left:
            yield held_J
        elif fault == "glitch" and rest <= 0:
            rest = 4
            wild_J = value_J + most_J * random.uniform(1, 4) * random.choice([-1, 1])
            yield float(random.choice([0.0 if value_J > most_J else np.nan, wild_J, np.nan, 1e300]))
        elif fault in ("stick", "gone"):
            left = int(random.integers(2, 5))
            held_J = floor(value_J) if fault == "stick" else None
            stalled = bool(held_J is not None and random.random() < 0.5)
            yield held_J
        else:
            value_J = 0.0 if fault == "reset" and rest < 0 and most_J < value_J < RANGE_J - most_J else value_J
            yield floor(value_J)
        rest -= 1


def floor(joules):
    """Energy rounded down to a step of the counter [J]."""
    return math.floor(joules / 61e-6) * 61e-6


@pytest.mark.slow
def test_no_joule_is_invented_and_none_is_lost_unmarked():
    """Over 300 random counters each interval with energy has the true one, each other a cause, and most have it."""
    intervals = measured = wraps = 0
    for seed in range(300):
        random = np.random.default_rng(seed)
        power_W = random.uniform(1, 60) * random.uniform(0.6, 1.6, 40)
        seconds = random.uniform(0.5, 2.0)
        history = History()
        for k, reading in enumerate(counted(random, seconds * power_W)):
            history, joules, mark = judge(facts(), history, reading, seconds)
            assert (joules is None) == (mark not in ("", "wrap"))
            assert joules is None or joules == pytest.approx(seconds * power_W[k], abs=3e-4), (seed, k, mark)
            intervals = intervals + 1
            measured = measured + (joules is not None)
            wraps = wraps + (mark == "wrap")
    assert measured > 0.5 * intervals
    assert wraps > 0


@given(
    st.lists(st.tuples(st.one_of(st.none(), st.floats()), st.floats(0.0, 100.0))),
    st.sampled_from([facts(), facts(wrap_J=None), facts(Kind.INTEGRATED, None)]),
)
def test_any_readings_give_energy_in_range_or_a_cause(tape, meter):
    history = History()
    for reading, seconds in tape:
        history, joules, mark = judge(meter, history, reading, seconds)
        assert (joules is None) == (mark not in ("", "wrap"))
        assert joules is None or 0.0 <= joules <= (seconds + 0.01) * meter.max_W + 61e-6
