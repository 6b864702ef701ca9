"""Displacement between k-DOPs against slow references."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from modt.geometry.kdop import AGREE_M, AXES, DIRECTIONS, measured, shape_similarity, shift_between

DISAGREEMENT, DECAY, SOFT_M = 0.3, 0.97, 0.3


def random_kdops(rng, n):
    """(8, n) k-DOPs, and others that differ from them little or much."""
    middle, half = rng.uniform(-2, 2, (4, n)), rng.uniform(0.1, 3.0, (4, n))
    a = np.concatenate([half + middle, half - middle])
    change = rng.normal(0, 1, (8, n)) * rng.choice([0.02, 0.3], n)
    return a, a + np.maximum(change, -rng.uniform(0.5, 0.9, (8, n)) * np.tile(half, (2, 1)))  # no width is negative


def square(centre, half):
    """(8, 1) k-DOP that reaches half a width in each direction."""
    return (np.asarray(centre) @ DIRECTIONS + half)[:, None]


def slow_moved(a, b, k):
    """Displacement along an axis, and from 0 to 1 how little its ends agree."""
    longest = max(*(a[:4] + a[4:]), *(b[:4] + b[4:]), 1.0)
    ahead, behind = b[k] - a[k], a[k + 4] - b[k + 4]
    agree = max(0.0, 1 - ((ahead - behind) * longest / AGREE_M) ** 2) ** 2
    return agree * (ahead + behind) / 2 + (1 - agree) * min(ahead, behind, key=abs), 1 - agree


def slow_measured(a, b, variance, before):
    """Displacement, covariance and end variances of one pair, axis by axis."""
    width_a, width_b = a[:4] + a[4:], b[:4] + b[4:]
    information, weighted, end_variance = np.zeros((2, 2)), np.zeros(2), []
    for k in range(4):
        axis, (moved, unlike) = AXES[:, k], slow_moved(a, b, k)
        new = unlike * (DISAGREEMENT * (width_b[k] - width_a[k])) ** 2
        end_variance.append(min(max(new, DECAY * before[k]), (DISAGREEMENT * max(width_b)) ** 2))
        information += np.outer(axis, axis) / (2 * (variance + end_variance[-1]))
        weighted += axis * moved / (2 * (variance + end_variance[-1]))
    covariance = np.linalg.inv(information)
    return covariance @ weighted, covariance, end_variance


def slow_similarity(a, b):
    """Difference of log sizes and overlap of one pair of k-DOPs, number by number."""
    sizes, squares = [], ([], [], [])
    for la, ha, lb, hb in zip(-a[4:], a[:4], -b[4:], b[:4], strict=True):
        sizes.append(abs(np.log(hb - lb + SOFT_M) - np.log(ha - la + SOFT_M)))
        common = max(min(ha, hb) - max(la, lb) + SOFT_M / 3, 0.0)
        for side, width in zip(squares, (ha - la + SOFT_M / 3, hb - lb + SOFT_M / 3, common), strict=True):
            side.append(width)
    areas_a, areas_b, common = ([s[0] * s[2], s[1] * s[3]] for s in squares)
    return sum(sizes) / 4, min(c / (p + q - c) for p, q, c in zip(areas_a, areas_b, common, strict=True))


def slow_shift(a, b):
    """Displacement of one pair of k-DOPs, axis by axis."""
    return sum(AXES[:, k] * slow_moved(a, b, k)[0] for k in range(4)) / 2


@given(st.integers(0, 6), st.integers(0, 2**16))
def test_measured_displacement_matches_the_slow_reference(n, seed):
    rng = np.random.default_rng(seed)
    a, b = random_kdops(rng, n)
    variance, before = rng.uniform(0.01, 1.0), rng.uniform(0, 0.5, (4, n))
    shift, covariance, end_variance = measured(a, b, variance, before)
    for k in range(n):
        slow = slow_measured(a[:, k], b[:, k], variance, before[:, k])
        for fast, one in zip((shift[k], covariance[k], end_variance[:, k]), slow, strict=True):
            np.testing.assert_allclose(fast, one, atol=1e-9)


@given(st.integers(0, 6), st.integers(0, 2**16))
def test_shift_and_similarity_match_the_slow_reference(n, seed):
    a, b = random_kdops(np.random.default_rng(seed), n)
    shift, (size, overlap) = shift_between(a, b), shape_similarity(a, b)
    for k in range(n):
        np.testing.assert_allclose(shift[k], slow_shift(a[:, k], b[:, k]), atol=1e-9)
        np.testing.assert_allclose((size[k], overlap[k]), slow_similarity(a[:, k], b[:, k]), atol=1e-9)


@given(st.floats(-3, 3), st.floats(-3, 3), st.floats(0.2, 3))
def test_the_displacement_of_an_unchanged_shape_is_exact(dx, dy, half):
    a, b = square((0, 0), half), square((dx, dy), half)
    size, overlap = shape_similarity(a, b)
    np.testing.assert_allclose(shift_between(a, b), [[dx, dy]], atol=1e-9)
    np.testing.assert_allclose(size, 0, atol=1e-9)
    assert 0 <= overlap[0] <= 1


@pytest.mark.parametrize("growth", [[2.0, 1.5, 0, 0, 0, 0, 0, 0], [0, 1.0, 2.0, 1.0, 0, 0, 0, 0]])
def test_growth_at_one_end_is_no_displacement(growth):
    before = square((0, 0), 1.0)
    after = before + np.array(growth)[:, None]
    np.testing.assert_allclose(shift_between(before, after), 0, atol=1e-9)


@given(st.integers(0, 2**16), st.floats(-1, 1), st.floats(-1, 1))
def test_an_unchanged_shape_has_no_end_variance(seed, dx, dy):
    a, _ = random_kdops(np.random.default_rng(seed), 5)
    b = a + (np.array([dx, dy]) @ DIRECTIONS)[:, None]
    shift, covariance, end_variance = measured(a, b, 0.04, np.zeros((4, 5)))
    np.testing.assert_allclose(shift, np.tile([dx, dy], (5, 1)), atol=1e-9)
    np.testing.assert_allclose(shift, shift_between(a, b), atol=1e-9)
    np.testing.assert_allclose(covariance, np.tile(0.04 * np.eye(2), (5, 1, 1)), atol=1e-9)
    np.testing.assert_allclose(end_variance, 0, atol=1e-9)
