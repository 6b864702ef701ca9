"""Times in bounded memory, beside the way that keeps them all."""

import random

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from modt.reporting.histogram import EXACT, Spread, cut

QUANTILES = (0.0, 0.25, 0.5, 0.95, 0.99, 1.0)


def spread_of(values):
    spread = Spread()
    for value in values:
        spread.add(value)
    return spread


def long_run(seed, n=30_000):
    """Times [ns] as a stage takes them: most alike, some far longer."""
    rng = np.random.default_rng(seed)
    return np.exp(rng.normal(np.log(5e6), 0.5 + rng.exponential(0.3, n), n)).astype(np.int64).tolist()


@given(st.lists(st.integers(0, 2**40), min_size=1, max_size=200))
def test_a_short_run_is_exact(values):
    spread = spread_of(values)
    assert (spread.count, spread.total, spread.greatest) == (len(values), sum(values), max(values))
    for share in QUANTILES:
        assert spread.quantile(share) == pytest.approx(np.quantile(values, share), rel=1e-12)


@pytest.mark.parametrize("seed", range(3))
def test_a_long_run_is_off_by_less_than_it_says_and_the_sums_by_nothing(seed):
    values = long_run(seed)
    spread = spread_of(values)
    assert (spread.count, spread.total, spread.greatest) == (len(values), sum(values), max(values))
    assert spread.mean == pytest.approx(np.mean(values), rel=1e-12)
    for share in QUANTILES:
        assert spread.quantile(share) == pytest.approx(np.quantile(values, share), rel=1 / 256)


def test_what_is_held_does_not_grow_with_the_run():
    spread = spread_of(long_run(0, 2 * EXACT))
    held = len(spread)
    assert held < EXACT
    for value in long_run(1, 50_000):
        spread.add(value)
    assert len(spread) < 2 * held
    for bits in range(63):  # nor does anything that a clock can say make it grow beyond the bound
        for value in range(2**bits, 2 ** (bits + 1), max(2**bits // 300, 1)):
            spread.add(value)
    assert len(spread) < 8000


def test_the_order_in_which_times_come_is_of_no_account():
    values = long_run(2)
    again = random.Random(0).sample(values, len(values))
    a, b = spread_of(values), spread_of(again)
    assert [a.quantile(q) for q in QUANTILES] == [b.quantile(q) for q in QUANTILES]


@given(st.integers(0, 2**62))
def test_a_cut_value_is_near(value):
    assert abs(cut(value) - value) <= value / 256
    assert cut(value) == value or value >= 256
