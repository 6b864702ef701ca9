"""k-DOPs and their overlap against slow references."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from modt.geometry.kdop import DIRECTIONS, centres, coverage, kdops, overlapping_pairs, widths
from tests.tracking.tracking_scenes import box, frame_of

PAD_M = 0.15


def random_ends(n, seed, max_length):
    """(n, 4) low and (n, 4) high ends, in half metres."""
    rng = np.random.default_rng(seed)
    middle, length = rng.integers(-20, 20, (n, 4)), rng.integers(0, max_length + 1, (n, 4))
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
    a, b = random_ends(n, seed, max_length), random_ends(k, seed + 1, max_length)
    i, j = overlapping_pairs(kdop(*a), kdop(*b))
    assert list(zip(i.tolist(), j.tolist(), strict=True)) == slow_overlapping_pairs(*a, *b)


def test_an_empty_envelope_overlaps_nothing():
    assert not len(overlapping_pairs(np.full((8, 15), -np.inf), kdop(*random_ends(15, 0, 30)))[0])


def test_pairs_do_not_depend_on_the_origin_of_the_world():
    origin = (np.array([-458_000, 5_430_000]) @ DIRECTIONS)[:, None]
    a, b = kdop(*random_ends(90, 1, 9)) + 0.51, kdop(*random_ends(70, 2, 9))
    near, far = overlapping_pairs(a, b), overlapping_pairs(a + origin, b + origin)
    assert len(near[0])
    np.testing.assert_array_equal(far, near)


@given(st.integers(0, 9), st.integers(0, 2**16))
def test_widths_and_centres(n, seed):
    low, high = random_ends(n, seed, 9)
    ends = kdop(low, high)
    np.testing.assert_array_equal(widths(ends), (high - low).T)
    np.testing.assert_array_equal(centres(ends), (high + low).T / 2)


@given(st.integers(0, 9), st.integers(0, 2**16))
def test_coverage_is_the_lesser_of_both_squares(n, seed):
    (low, high), (low_position, high_position) = random_ends(n, seed, 9), random_ends(n, seed + 1, 30)
    found = coverage(kdop(low, high), kdop(low_position, high_position))
    for i in range(n):
        part = [
            max(min(high[i, k], high_position[i, k] + PAD_M) - max(low[i, k], low_position[i, k] - PAD_M), 0.0)
            / max(high[i, k] - low[i, k], PAD_M)
            for k in range(4)
        ]
        np.testing.assert_allclose(found[i], min(part[0] * part[2], part[1] * part[3]))


def test_kdops_are_the_greatest_coordinates_of_the_points():
    c, s = np.cos(0.4), np.sin(0.4)
    T = np.array([[c, -s, 0, 5], [s, c, 0, -3], [0, 0, 1, 1.7], [0, 0, 0, 1.0]])
    frame, proposals = frame_of([box(10, 0, yaw=0.3), box(-4, 7)], 0, T)
    found = kdops(proposals, T)
    world = frame.points[:, :3] @ T[:3, :3].T + T[:3, 3]
    for i in range(2):
        along = world[proposals.members[proposals.offsets[i] : proposals.offsets[i + 1]], :2] @ DIRECTIONS
        np.testing.assert_allclose(found[:, i], along.max(axis=0), atol=1e-4)
    assert kdops(proposals.take(np.zeros(0, np.int64)), T).shape == (8, 0)
