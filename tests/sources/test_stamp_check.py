"""Stamps that lie, and clocks that are set."""

import itertools

import pytest
from hypothesis import given
from hypothesis import strategies as st

from modt.sources.stamp_check import StampCheck

PERIOD_S = 0.1
MOST_LOST = 10
"""Greatest number of sweeps that are lost when a clock is set: a second of them."""
AT = st.integers(1, 58)
STEP_S = st.floats(-1e9, 1e9).filter(lambda s: abs(s) > 2)


def believed(stamps, arrivals):
    """Indices of the accepted messages, their corrected stamps, and the check."""
    check = StampCheck()
    kept = []
    for k, (stamp_s, arrived_s) in enumerate(zip(stamps, arrivals, strict=True)):
        if not check.doubt(stamp_s, arrived_s):
            kept.append((k, stamp_s + check.shift_s))
    return [k for k, _ in kept], [stamp_s for _, stamp_s in kept], check


def even(n, begin=0.0):
    return [begin + k * PERIOD_S for k in range(n)]


SET = {  # changes of the stamps and of the arrivals, by a step from a message on; greatest number of messages lost
    "the clock of the sensor": (lambda step_s: step_s, lambda step_s: 0.0, MOST_LOST),
    "the clock of the arrivals": (lambda step_s: 0.0, lambda step_s: step_s, 0),
    "a clock that both share, back": (lambda step_s: -abs(step_s), lambda step_s: -abs(step_s), 0),
    "a clock that both share, far ahead": (lambda step_s: 1e5 + abs(step_s), lambda step_s: 1e5 + abs(step_s), 0),
}


@pytest.mark.parametrize("clock", SET)
@given(AT, STEP_S)
def test_a_clock_that_is_set_costs_less_than_a_second_and_stamps_go_on(clock, at, step_s):
    of_stamps, of_arrivals, most_lost = SET[clock]
    stamps = [s + (of_stamps(step_s) if k >= at else 0.0) for k, s in enumerate(even(60, 1.7e9))]
    arrivals = [s + (of_arrivals(step_s) if k >= at else 0.0) for k, s in enumerate(even(60))]
    numbers, corrected, check = believed(stamps, arrivals)
    assert len(numbers) >= min(60 - most_lost, at)
    assert numbers[:at] == list(range(at))
    assert corrected == pytest.approx([1.7e9 + k * PERIOD_S for k in numbers], abs=1e-5)
    if most_lost:
        assert check.steps == (len(numbers) > at)
    else:
        assert len(numbers) == 60


@given(AT, STEP_S)
def test_one_stamp_that_lies_costs_its_sweep_alone(at, step_s):
    stamps = [s + (step_s if k == at else 0.0) for k, s in enumerate(even(60))]
    numbers, corrected, check = believed(stamps, even(60))
    assert numbers == [k for k in range(60) if k != at]
    assert corrected == pytest.approx([k * PERIOD_S for k in numbers])
    assert check.steps == 0


def test_a_pause_is_no_lie():
    stamps = even(10) + even(10, 100.0)
    assert believed(stamps, stamps)[0] == list(range(20))


def test_arrivals_that_stand_still_do_not_end_the_recording():
    stamps = even(10) + even(20, 100.0)
    numbers, _, _ = believed(stamps, [0.0] * 30)
    assert len(numbers) >= 30 - MOST_LOST
    assert numbers[-1] == 29


@given(st.lists(st.tuples(st.floats(-1e10, 1e10), st.floats(-1e10, 1e10)), max_size=50))
def test_corrected_stamps_never_fall_by_more_than_rounding(messages):
    _, corrected, _ = believed(*zip(*messages, strict=True)) if messages else ([], [], None)
    assert all(b >= a - 1e-3 for a, b in itertools.pairwise(corrected))
