"""Times in bounded memory, compared with a list of them all."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from modt.reporting.histogram import Histogram

QUANTILES = (0.0, 0.25, 0.5, 0.95, 0.99, 1.0)


def histogram_of(values, *bits):
    spread = Histogram(*bits)
    for value in values:
        spread.add(value)
    return spread


def long_run(seed):
    """Times [ns] as a stage takes them: most alike, some far longer."""
    rng = np.random.default_rng(seed)
    return np.exp(rng.normal(np.log(5e6), 0.5 + rng.exponential(0.3, 30_000))).astype(np.int64).tolist()


@given(st.lists(st.integers(0, 255), min_size=1, max_size=200))
def test_small_values_are_exact(values):
    spread = histogram_of(values)
    for share in QUANTILES:
        assert spread.quantile(share) == pytest.approx(np.quantile(values, share), rel=1e-12)


def test_no_values_and_negative_ones_have_figures():
    spread = Histogram()
    assert spread.figures(1.0, p50=0.5) == {"mean": 0, "p50": 0, "max": 0}
    spread.add(-7)
    spread.add(3)
    assert spread.figures(0.5, p50=0.5) == {"mean": 3, "p50": 3, "max": 6}
    assert spread.occurrences() == {"values": [0, 3], "counts": [1, 1]}


@pytest.mark.parametrize(("seed", "bits"), [(0, 8), (1, 3), (1, 5), (1, 8), (2, 8)])
def test_quantiles_of_many_values_are_within_the_error_of_the_bits_that_are_held(seed, bits):
    values = long_run(seed)
    spread = histogram_of(values, bits)
    assert (spread.count, spread.total, spread.maximum) == (len(values), sum(values), max(values))
    assert spread.mean == pytest.approx(np.mean(values), rel=1e-12)
    assert len(spread.occurrences()["values"]) <= 2 ** (bits - 1) * np.log2(2 * max(values) / min(values)) + 1
    for share in QUANTILES:
        assert spread.quantile(share) == pytest.approx(np.quantile(values, share), rel=2.0**-bits)


def test_nothing_that_a_clock_can_say_makes_it_grow_beyond_its_bound():
    spread = Histogram()
    for bits in range(63):
        for value in range(2**bits, 2 ** (bits + 1), max(2**bits // 300, 1)):
            spread.add(value)
    assert len(spread.occurrences()["values"]) < 8000
