"""Outlines and their overlaps against the obvious."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from modt.tracking import sightings
from modt.tracking.sightings import girth, touching


def outlines(n, seed, longest):
    rng = np.random.default_rng(seed)
    middle, length = rng.integers(-20, 20, (n, 4)), rng.integers(0, longest + 1, (n, 4))
    return middle - length / 2, middle + length / 2


def slow_touching(low_a, high_a, low_b, high_b):
    return [
        (i, j)
        for i in range(len(low_a))
        for j in range(len(low_b))
        if all(low_a[i, k] <= high_b[j, k] and high_a[i, k] >= low_b[j, k] for k in (0, 2))
    ]


@pytest.mark.parametrize("few", [0, 10**9], ids=["sorted", "all compared"])
@given(st.integers(0, 15), st.integers(0, 15), st.integers(0, 2**16), st.integers(0, 30))
def test_touching_outlines(few, n, k, seed, longest):
    a, b = outlines(n, seed, longest), outlines(k, seed + 1, longest)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sightings, "FEW_PAIRS", few)
        i, j = touching(*a, *b)
    assert list(zip(i.tolist(), j.tolist(), strict=True)) == slow_touching(*a, *b)


@pytest.mark.parametrize("few", [0, 10**9], ids=["sorted", "all compared"])
def test_what_was_never_seen_touches_nothing(few, monkeypatch):
    monkeypatch.setattr(sightings, "FEW_PAIRS", few)
    low, high = outlines(6, 0, 30)
    nothing = np.full((2, 4), np.inf), np.full((2, 4), -np.inf)
    assert len(touching(*nothing, low, high)[0]) == len(touching(low, high, *nothing)[0]) == 0


@given(st.integers(0, 9), st.integers(0, 2**16))
def test_girth(n, seed):
    low, high = outlines(n, seed, 9)
    np.testing.assert_array_equal(girth(low, high), (high - low).sum(axis=1))
