"""k-DOPs, their overlap, displacement and costs against slow references."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from modt.geometry import rotation_zyx, se3
from modt.geometry.kdop import (
    AXES,
    DIRECTIONS,
    PairWeights,
    Shapes,
    certain_pairs,
    overlapping_pairs,
    shape_similarity,
    shift_between,
)
from modt.geometry.kernels import NUMPY_GEOMETRY
from modt.geometry.tuning import ShapeTuning
from modt.observations import observe
from modt.types import Proposals
from tests.tracking.tracking_scenes import box, frame_of

TUNING = ShapeTuning()
WEIGHTS = PairWeights(size=1.5, overlap=0.8, height=2.0, points=0.5)


def random_ends(n, seed, max_length):
    """(n, 4) low and (n, 4) high ends, in half metres."""
    rng = np.random.default_rng(seed)
    middle = rng.integers(-20, 20, (n, 4))
    length = rng.integers(0, max_length + 1, (n, 4))
    return middle - length / 2, middle + length / 2


def kdop(low, high):
    return np.concatenate([high, -low], axis=1).T


def slow_overlapping_pairs(low_a, high_a, low_b, high_b):
    """Interval by interval along x and y."""
    pairs = []
    for i in range(len(low_a)):
        overlap = np.logical_and.reduce(
            [(low_a[i, k] <= high_b[:, k]) & (high_a[i, k] >= low_b[:, k]) for k in (0, 2)]
        )
        pairs += [(i, j) for j in np.flatnonzero(overlap).tolist()]
    return pairs


@given(n=st.integers(0, 30), k=st.integers(0, 30), seed=st.integers(0, 2**16), max_length=st.integers(0, 30))
def test_overlapping_pairs_match_the_slow_reference(n, k, seed, max_length):
    a = random_ends(n, seed, max_length)
    b = random_ends(k, seed + 1, max_length)
    i, j = overlapping_pairs(kdop(*a), kdop(*b))
    assert list(zip(i.tolist(), j.tolist(), strict=True)) == slow_overlapping_pairs(*a, *b)


def test_an_empty_envelope_overlaps_nothing():
    assert not len(overlapping_pairs(np.full((8, 15), -np.inf), kdop(*random_ends(15, 0, 30)))[0])


@given(st.integers(0, 9), st.integers(0, 2**16))
def test_coverage_is_the_lesser_of_both_squares(n, seed):
    low, high = random_ends(n, seed, 9)
    low_position, high_position = random_ends(n, seed + 1, 30)
    rows, columns = np.random.default_rng(seed).integers(0, max(n, 1), (2, n))
    jitter_m = TUNING.end_jitter_m
    found = NUMPY_GEOMETRY.coverage(kdop(low, high), kdop(low_position, high_position), rows, columns)
    for one, i, j in zip(found, rows, columns, strict=True):
        common = np.minimum(high[i], high_position[j] + jitter_m) - np.maximum(low[i], low_position[j] - jitter_m)
        part = np.maximum(common, 0.0) / np.maximum(high[i] - low[i], jitter_m)
        assert_allclose(one, min(part[0] * part[2], part[1] * part[3]))


def test_kdops_are_the_greatest_coordinates_of_the_points():
    T = se3(rotation_zyx(0, 0, 0.4), np.array([5, -3, 1.7]))
    frame, proposals = frame_of([box(10, 0, yaw=0.3), box(-4, 7)], 0, T)
    found = observe(proposals, T).kdop
    world = frame.points[:, :3] @ T[:3, :3].T + T[:3, 3]
    for i in range(2):
        along = world[proposals.members[proposals.offsets[i] : proposals.offsets[i + 1]], :2] @ DIRECTIONS
        assert_allclose(found[:, i], along.max(axis=0), atol=1e-4)
    assert observe(Proposals.empty(), T).kdop.shape == (8, 0)


def random_kdops(rng, n):
    """(8, n) k-DOPs, and others that differ from them little or much."""
    middle = rng.uniform(-2, 2, (4, n))
    half = rng.uniform(0.1, 3.0, (4, n))
    a = np.concatenate([half + middle, half - middle])
    change = rng.normal(0, 1, (8, n)) * rng.choice([0.02, 0.3], n)
    return a, a + np.maximum(change, -rng.uniform(0.5, 0.9, (8, n)) * np.tile(half, (2, 1)))  # no width is negative


def slow_shift_along(a, b, k, seen_along=0.0):
    """Displacement along an axis, and from 0 to 1 how little its ends agree.

    The axis lies along the line of sight by `seen_along`, the cosine of the angle between them.
    """
    longest = max(*(a[:4] + a[4:]), *(b[:4] + b[4:]), 1.0)
    ahead = b[k] - a[k]
    behind = a[k + 4] - b[k + 4]
    agree = max(0.0, 1 - ((ahead - behind) * longest / TUNING.agreement_m) ** 2) ** 2
    end = min(ahead, behind, key=abs)
    if abs(seen_along) > TUNING.near_cosine:
        end = behind if seen_along > 0 else ahead
    return agree * (ahead + behind) / 2 + (1 - agree) * end, 1 - agree


def slow_measured(a, b, sight, variance, before):
    """Displacement, covariance and end variances of one pair, axis by axis."""
    width = b[:4] + b[4:]
    growth = width - (a[:4] + a[4:])
    information = np.zeros((2, 2))
    weighted = np.zeros(2)
    end_variance = []
    for k in range(4):
        seen_along = AXES[:, k] @ sight
        shift, disagreement = slow_shift_along(a, b, k, seen_along)
        along, across = seen_along, np.sqrt(max(1 - seen_along**2, 0.0))
        doubt = TUNING.disagreement
        if abs(seen_along) > TUNING.near_cosine:
            doubt = np.hypot(along * TUNING.near_disagreement, across * TUNING.disagreement)
        by_ends = disagreement * (doubt * growth[k]) ** 2
        by_ends = max(by_ends, TUNING.end_variance_decay * before[k])
        end_variance.append(min(by_ends, (doubt * max(width)) ** 2))
        weight = 1 / (2 * (variance + end_variance[-1]))
        information += weight * np.outer(AXES[:, k], AXES[:, k])
        weighted += weight * shift * AXES[:, k]
    covariance = np.linalg.inv(information)
    return covariance @ weighted, covariance, end_variance


def slow_similarity(a, b):
    """Difference of log sizes and overlap of one pair of k-DOPs."""
    width_a, width_b, common = (kdop[:4] + kdop[4:] for kdop in (a, b, np.minimum(a, b)))
    size = abs(np.log(width_b + TUNING.width_softening_m) - np.log(width_a + TUNING.width_softening_m)).mean()
    widths = np.maximum(np.stack([width_a, width_b, common]) + TUNING.area_padding_m, 0.0)
    area_a, area_b, shared = widths[:, :2] * widths[:, 2:]  # upright, and at 45 degrees
    return size, min(shared / (area_a + area_b - shared))


def slow_shift(a, b):
    """Displacement of one pair of k-DOPs, axis by axis."""
    return sum(AXES[:, k] * slow_shift_along(a, b, k)[0] for k in range(4)) / 2


def random_sights(rng, n):
    """(2, n) unit vectors."""
    bearing = rng.uniform(-np.pi, np.pi, n)
    return np.stack([np.cos(bearing), np.sin(bearing)])


def kdop_of_rectangle(near_m, far_m, half_m):
    """(8, 1) k-DOP of a rectangle from near_m to far_m along x, and half_m to either side."""
    corners = np.array([(x, y) for x in (near_m, far_m) for y in (-half_m, half_m)])
    return (corners @ DIRECTIONS).max(axis=0)[:, None]


@pytest.mark.parametrize("far_m", [20.5, 23.2, 24.0])
def test_what_hides_its_own_far_end_moves_as_its_near_end(far_m):
    # A car comes nearer by 0.8 m; how far its roof is seen changes by itself.
    before = kdop_of_rectangle(20.0, 22.0, 0.9)
    after = kdop_of_rectangle(19.2, far_m, 0.9)
    sight = np.array([[1.0], [0.0]])
    shift, covariance, _ = NUMPY_GEOMETRY.measured(before, after, sight, 0.05**2, np.zeros((4, 1)))
    assert_allclose(shift[0], (-0.8, 0.0), atol=0.05)
    assert covariance[0, 0, 0] < 0.2**2


@pytest.mark.parametrize("bearing_deg", [-15.0, 0.0, 15.0])
def test_a_side_that_comes_into_view_leaves_the_displacement_across_the_line_of_sight_in_doubt(bearing_deg):
    # A car drives away by 0.4 m, and its left side comes out of hiding.
    before = kdop_of_rectangle(20.0, 24.0, 0.6)
    after = kdop_of_rectangle(20.4, 24.4, 0.6)
    after[2] += 0.65  # the end to the left
    after[[1, 3]] += 0.65 / np.sqrt(2)
    bearing = np.deg2rad(bearing_deg)
    sight = np.array([[np.cos(bearing)], [np.sin(bearing)]])
    shift, covariance, _ = NUMPY_GEOMETRY.measured(before, after, sight, 0.05**2, np.zeros((4, 1)))
    assert shift[0, 0] == pytest.approx(0.4, abs=0.1)
    assert abs(shift[0, 1]) < 3 * np.sqrt(covariance[0, 1, 1])


@given(st.integers(0, 6), st.integers(0, 2**16))
def test_measured_displacement_matches_the_slow_reference(n, seed):
    rng = np.random.default_rng(seed)
    a, b = random_kdops(rng, n)
    variance = rng.uniform(0.01, 1.0)
    before = rng.uniform(0, 0.5, (4, n))
    sight = random_sights(rng, n)
    shift, covariance, end_variance = NUMPY_GEOMETRY.measured(a, b, sight, variance, before)
    for k in range(n):
        slow = slow_measured(a[:, k], b[:, k], sight[:, k], variance, before[:, k])
        for fast, one in zip((shift[k], covariance[k], end_variance[:, k]), slow, strict=True):
            assert_allclose(fast, one, atol=1e-9)


@given(st.integers(0, 6), st.integers(0, 2**16))
def test_shift_and_similarity_match_the_slow_reference(n, seed):
    a, b = random_kdops(np.random.default_rng(seed), n)
    shift = shift_between(a, b, TUNING)
    size, overlap = shape_similarity(a, b, TUNING)
    for k in range(n):
        assert_allclose(shift[k], slow_shift(a[:, k], b[:, k]), atol=1e-9)
        assert_allclose((size[k], overlap[k]), slow_similarity(a[:, k], b[:, k]), atol=1e-9)


@pytest.mark.parametrize("growth", [[2.0, 1.5, 0, 0, 0, 0, 0, 0], [0, 1.0, 2.0, 1.0, 0, 0, 0, 0]])
def test_growth_at_one_end_is_no_displacement(growth):
    before = np.ones((8, 1))
    after = before + np.array(growth)[:, None]
    assert_allclose(shift_between(before, after, TUNING), 0, atol=1e-9)


def shapes(rng, kdop):
    n = kdop.shape[1]
    bottom = rng.uniform(-2, 0, n)
    return Shapes.of(kdop, bottom, bottom + rng.uniform(0.2, 3, n), rng.integers(1, 500, n), TUNING)


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
    found = NUMPY_GEOMETRY.pair_costs(a, b, covariance, variance, pairs, WEIGHTS)
    for i, j, cost, covered in zip(*pairs, *found, strict=True):
        ends = [min(b.kdop[k, j] - a.kdop[k, i], a.kdop[k + 4, i] - b.kdop[k + 4, j], key=abs) for k in range(4)]
        xx, xy, yy = covariance[:, i]
        shift = AXES @ ends / 2
        S = np.array([[xx, xy], [xy, yy]]) + variance * np.eye(2)
        displacement = (shift @ np.linalg.inv(S) @ shift + np.log(np.linalg.det(S / variance))) / 2
        size, overlap = slow_similarity(a.kdop[:, i], b.kdop[:, j])
        height = abs(a.top[i] - b.top[j]) + abs(a.bottom[i] - b.bottom[j])
        count = abs(a.log_points[i] - b.log_points[j])
        shape = 1.5 * size + 0.8 * (1 - overlap) + 2.0 * height / 2 + 0.5 * count
        assert_allclose(cost, displacement + shape, atol=1e-9)
        assert overlap - 1e-9 <= covered <= 1


def test_pairs_without_a_rival_are_certain():
    rows = np.array([0, 1, 1, 2, 3])
    columns = np.array([0, 1, 2, 2, 3])
    for cost, certain, contested in (
        ([0.5, 0.1, 0.2, 0.1, 0.9], [0, 1, 3, 4], []),
        ([0.5, 0.5, 0.2, 0.3, 0.9], [0, 4], [1, 2, 3]),
    ):
        found = certain_pairs(rows, columns, np.array(cost), 1.0)
        assert [pairs.tolist() for pairs in found] == [certain, contested]
