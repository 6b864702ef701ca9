"""Costs of pairs of k-DOPs against slow references."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from modt.geometry.kdop import AXES, PairWeights, Shapes, certain_pairs, pair_costs
from tests.geometry.test_kdop_displacement import random_kdops, slow_similarity, square

WEIGHTS = PairWeights(size=1.5, overlap=0.8, height=2.0, points=0.5)


def shapes(rng, kdop):
    n = kdop.shape[1]
    bottom = rng.uniform(-2, 0, n)
    return Shapes.of(kdop, bottom, bottom + rng.uniform(0.2, 3, n), rng.integers(1, 500, n))


def random_pairs(seed, n):
    """Two sets of n shapes, covariances, a variance, and some of their pairs."""
    rng = np.random.default_rng(seed)
    a, b = (shapes(rng, kdop) for kdop in random_kdops(rng, n))
    root = rng.normal(size=(n, 2, 2))
    P = root @ root.transpose(0, 2, 1) + 0.1 * np.eye(2)
    covariance = np.stack([P[:, 0, 0], P[:, 0, 1], P[:, 1, 1]])
    pairs = np.divmod(rng.permutation(n * n)[: 2 * n], max(n, 1))
    return a, b, covariance, rng.uniform(0.01, 1), pairs


@given(st.integers(0, 2**16), st.integers(0, 6))
def test_costs_equal_those_of_pairs_one_by_one(seed, n):
    a, b, covariance, variance, pairs = random_pairs(seed, n)
    found = pair_costs(a, b, covariance, variance, pairs, WEIGHTS)
    for i, j, cost, coverage in zip(*pairs, *found, strict=True):
        ends = [min(b.kdop[k, j] - a.kdop[k, i], a.kdop[k + 4, i] - b.kdop[k + 4, j], key=abs) for k in range(4)]
        xx, xy, yy = covariance[:, i]
        shift = AXES @ ends / 2
        S = np.array([[xx, xy], [xy, yy]]) + variance * np.eye(2)
        displacement = (shift @ np.linalg.inv(S) @ shift + np.log(np.linalg.det(S / variance))) / 2
        size, overlap = slow_similarity(a.kdop[:, i], b.kdop[:, j])
        height = abs(a.top[i] - b.top[j]) + abs(a.bottom[i] - b.bottom[j])
        count = abs(a.log_count[i] - b.log_count[j])
        shape = 1.5 * size + 0.8 * (1 - overlap) + 2.0 * height / 2 + 0.5 * count
        np.testing.assert_allclose(cost, displacement + shape, atol=1e-9)
        assert overlap - 1e-9 <= coverage <= 1


@given(st.floats(-1, 1), st.floats(-1, 1), st.floats(0, 1))
def test_the_displacement_of_a_displaced_shape_is_that_of_its_centre(dx, dy, variance_m2):
    rng, pair, S = np.random.default_rng(0), np.zeros(1, np.int64), variance_m2 + 0.3
    covariance = np.array([[variance_m2], [0.0], [variance_m2]])
    given = shapes(rng, square((0, 0), 1.0)), shapes(rng, square((dx, dy), 1.0)), covariance, 0.3, (pair, pair)
    cost, _ = pair_costs(*given, PairWeights(0.0, 0.0, 0.0, 0.0))
    np.testing.assert_allclose(cost, (dx**2 + dy**2) / S / 2 + np.log(S / 0.3), atol=1e-9)


def test_pairs_without_a_rival_are_certain():
    rows, columns = np.array([0, 1, 1, 2, 3]), np.array([0, 1, 2, 2, 3])
    cost = np.array([0.5, 0.1, 0.2, 0.1, 0.9])
    certain, contested = certain_pairs(rows, columns, cost, 1.0)
    assert certain.tolist() == [0, 1, 3, 4]
    assert contested.tolist() == []
    certain, contested = certain_pairs(rows, columns, np.array([0.5, 0.5, 0.2, 0.3, 0.9]), 1.0)
    assert certain.tolist() == [0, 4]
    assert contested.tolist() == [1, 2, 3]
