import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from modt.geometry.kdop import AXES, DIRECTIONS
from modt.geometry.kdop_displacement import AGREE_M, DOUBT, KEPT, measured, shift_between


def kdops(rng, n):
    """(8, n) outlines, and others that are nearly alike, or not."""
    middle, half = rng.uniform(-2, 2, (4, n)), rng.uniform(0.1, 3.0, (4, n))
    a = np.concatenate([half + middle, half - middle])
    return a, a + rng.normal(0, 1, (8, n)) * rng.choice([0.02, 0.3], n)


def slow_measure(a, b, variance, before):
    """Shift, covariance and doubts of one pair of outlines, axis by axis."""
    length_a, length_b = [[o[k] + o[k + 4] for k in range(4)] for o in (a, b)]
    longest = max(*length_a, *length_b, 1.0)
    information, said, doubts = np.zeros((2, 2)), np.zeros(2), []
    for k in range(4):
        ahead, behind, axis = b[k] - a[k], a[k + 4] - b[k + 4], AXES[:, k]
        agree = max(0.0, 1 - ((ahead - behind) * longest / AGREE_M) ** 2) ** 2
        moved = agree * (ahead + behind) / 2 + (1 - agree) * min(ahead, behind, key=abs)
        new = (1 - agree) * (DOUBT * (length_b[k] - length_a[k])) ** 2
        doubts.append(min(max(new, KEPT * before[k]), (DOUBT * max(length_b)) ** 2))
        information += np.outer(axis, axis) / (2 * (variance + doubts[-1]))
        said += axis * moved / (2 * (variance + doubts[-1]))
    covariance = np.linalg.inv(information)
    return covariance @ said, covariance, doubts


@given(st.integers(0, 6), st.integers(0, 2**16))
def test_a_measure_is_the_slow_one_row_by_row(n, seed):
    rng = np.random.default_rng(seed)
    a, b = kdops(rng, n)
    variance, before = rng.uniform(0.01, 1.0, n), rng.uniform(0, 0.5, (4, n))
    shift, covariance, doubt = measured(a, b, variance, before)
    for k in range(n):
        slow = slow_measure(a[:, k], b[:, k], variance[k], before[:, k])
        for fast, one in zip((shift[k], covariance[k], doubt[:, k]), slow, strict=True):
            np.testing.assert_allclose(fast, one, atol=1e-9)


@given(st.integers(0, 2**16), st.floats(-1, 1), st.floats(-1, 1))
def test_what_keeps_its_shape_is_not_doubted(seed, dx, dy):
    a, _ = kdops(np.random.default_rng(seed), 5)
    b = a + (np.array([dx, dy]) @ DIRECTIONS)[:, None]
    shift, covariance, doubt = measured(a, b, np.full(5, 0.04), np.zeros((4, 5)))
    np.testing.assert_allclose(shift, np.tile([dx, dy], (5, 1)), atol=1e-9)
    np.testing.assert_allclose(shift, shift_between(a, b), atol=1e-9)
    np.testing.assert_allclose(covariance, np.tile(0.04 * np.eye(2), (5, 1, 1)), atol=1e-9)
    np.testing.assert_allclose(doubt, 0, atol=1e-9)


def test_what_comes_into_view_is_doubted_along_its_length_and_for_a_while():
    before = (np.array([1.0, 0.0]) @ DIRECTIONS + 1.0)[:, None]
    after = before + np.array([1.5, 0, 0, 0, 0, 0, 0, 0])[:, None]
    _, covariance, doubt = measured(before, after, np.full(1, 0.01), np.zeros((4, 1)))
    np.testing.assert_allclose(doubt[:, 0], [(DOUBT * 1.5) ** 2, 0, 0, 0])
    assert covariance[0, 0, 0] > 1.9 * covariance[0, 1, 1]  # the slanting axes see along it, too
    _, _, later = measured(after, after, np.full(1, 0.01), doubt)
    np.testing.assert_allclose(later, KEPT * doubt)


def test_no_more_is_doubted_than_what_is_seen():
    """What parted from a wall lies within its own outline."""
    wall, person = np.full((8, 1), 5.0), np.full((8, 1), 0.3)
    _, _, doubt = measured(wall, person, np.full(1, 0.01), np.zeros((4, 1)))
    np.testing.assert_allclose(doubt, (DOUBT * 0.6) ** 2)
