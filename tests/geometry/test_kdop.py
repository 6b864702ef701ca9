"""Outlines and their overlaps against the obvious."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from modt.geometry import kdop as kdop_module
from modt.geometry.kdop import DIRECTIONS, PAD_M, centres, coverage, overlapping_pairs, width_sum, widths


def ends(n, seed, longest):
    """(n, 4) low and (n, 4) high ends."""
    rng = np.random.default_rng(seed)
    middle, length = rng.integers(-20, 20, (n, 4)), rng.integers(0, longest + 1, (n, 4))
    return middle - length / 2, middle + length / 2


def kdop(low, high):
    return np.concatenate([high, -low], axis=1).T


def slow_touching(low_a, high_a, low_b, high_b):
    return [
        (i, j)
        for i in range(len(low_a))
        for j in range(len(low_b))
        if all(low_a[i, k] <= high_b[j, k] and high_a[i, k] >= low_b[j, k] for k in (0, 2))
    ]


HOW = pytest.mark.parametrize("few", [(10**9, 0), (0, 10**9), (0, 0)], ids=["handful", "all compared", "sorted"])


def found(patch, few, a, b):
    """What touches, found as if so many pairs were few."""
    patch.setattr(kdop_module, "HANDFUL", few[0])
    patch.setattr(kdop_module, "FEW_PAIRS", few[1])
    return overlapping_pairs(a, b)


@HOW
@given(st.integers(0, 15), st.integers(0, 15), st.integers(0, 2**16), st.integers(0, 30))
def test_touching_outlines(few, n, k, seed, longest):
    a, b = ends(n, seed, longest), ends(k, seed + 1, longest)
    with pytest.MonkeyPatch.context() as patch:
        i, j = found(patch, few, kdop(*a), kdop(*b))
    assert list(zip(i.tolist(), j.tolist(), strict=True)) == slow_touching(*a, *b)


@HOW
def test_what_was_never_seen_touches_nothing(few, monkeypatch):
    something, nothing = kdop(*ends(6, 0, 30)), np.full((8, 2), -np.inf)
    assert not len(found(monkeypatch, few, nothing, something)[0])


@HOW
@pytest.mark.parametrize("origin", [(0, 0), (-458_000, 5_430_000)], ids=["here", "UTM"])
def test_where_the_world_begins_does_not_matter(few, origin, monkeypatch):
    start = (origin @ DIRECTIONS)[:, None]
    a, b = kdop(*ends(15, 1, 9)) + 0.51, kdop(*ends(15, 2, 9))
    here, there = found(monkeypatch, few, a, b), found(monkeypatch, few, a + start, b + start)
    assert len(here[0])
    np.testing.assert_array_equal(there, here)


@HOW
def test_what_lies_apart_does_not_touch_however_far_away(few, monkeypatch):
    a = kdop(*ends(5, 1, 9)) + (np.array([2_000.0, 0.0]) @ DIRECTIONS)[:, None]
    assert not len(found(monkeypatch, few, a, kdop(*ends(5, 2, 9)))[0])


@given(st.integers(0, 9), st.integers(0, 2**16))
def test_lengths_and_middles(n, seed):
    low, high = ends(n, seed, 9)
    one = kdop(low, high)
    np.testing.assert_array_equal(widths(one), (high - low).T)
    np.testing.assert_array_equal(centres(one), (high + low).T / 2)
    np.testing.assert_array_equal(width_sum(one), (high - low).sum(axis=1))


@given(st.integers(0, 9), st.integers(0, 2**16))
def test_what_is_covered_is_so_in_both_squares(n, seed):
    (low, high), (low_place, high_place) = ends(n, seed, 9), ends(n, seed + 1, 30)
    part = coverage(kdop(low, high), kdop(low_place, high_place))
    for i in range(n):
        along = [
            max(min(high[i, k], high_place[i, k] + PAD_M) - max(low[i, k], low_place[i, k] - PAD_M), 0.0)
            / max(high[i, k] - low[i, k], PAD_M)
            for k in range(4)
        ]
        np.testing.assert_allclose(part[i], min(along[0] * along[2], along[1] * along[3]))
