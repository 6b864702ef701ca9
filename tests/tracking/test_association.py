import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.optimize import linear_sum_assignment

from modt.config import TrackingConfig
from modt.geometry.kdop import DIRECTIONS
from modt.observations import observe
from modt.tracking.association import FORBIDDEN, PaperAssociation, assign, assign_all
from modt.tracking.states import EFFICIENT
from tests.tracking.tracking_scenes import Follower, box, frame_of

EYE = np.eye(4)


@given(arrays(np.float64, (6, 5), elements=st.floats(0, 2)))
def test_sparse_assignment_is_the_dense_one(cost):
    rows, columns = np.nonzero(cost < 1)
    keep = assign(rows, columns, cost[rows, columns], FORBIDDEN)
    assert len(set(rows[keep])) == len(set(columns[keep])) == len(keep)
    dense = np.where(cost < 1, cost, FORBIDDEN)
    i, j = linear_sum_assignment(dense)
    real = dense[i, j] < FORBIDDEN
    assert len(keep) == real.sum()
    np.testing.assert_allclose(cost[rows, columns][keep].sum(), dense[i, j][real].sum(), atol=1e-9)


@given(st.integers(1, 12), st.integers(1, 12), st.floats(0.5, 8), st.integers(0, 2**16))
def test_what_is_kept_for_certain_is_in_the_dense_assignment(n, k, limit, seed):
    cost = np.random.default_rng(seed).uniform(0, 8, (n, k))
    rows, columns = np.nonzero(cost < limit)
    keep = assign(rows, columns, cost[rows, columns], limit)
    i, j = assign_all(cost, limit)
    np.testing.assert_array_equal(rows[keep], i)
    np.testing.assert_array_equal(columns[keep], j)


def greatest_gain(cost, limit):
    """What the best of all ways to pair rows and columns saves below the limit, one pair after the other tried."""
    if not len(cost):
        return 0.0
    alone = greatest_gain(cost[1:], limit)
    paired = [
        limit - cost[0, j] + greatest_gain(np.delete(cost[1:], j, axis=1), limit)
        for j in np.flatnonzero(cost[0] < limit)
    ]
    return max([alone, *paired])


@given(st.integers(0, 4), st.integers(0, 4), st.integers(0, 2**16))
def test_no_assignment_of_few_to_few_is_cheaper(n, k, seed):
    cost = np.random.default_rng(seed).uniform(0, 2, (n, k))
    rows, columns = assign_all(cost, 1.0)
    assert len(set(rows)) == len(set(columns)) == len(rows)
    assert (cost[rows, columns] < 1).all()
    np.testing.assert_allclose((1 - cost[rows, columns]).sum(), greatest_gain(cost, 1.0), atol=1e-9)


def candidates(before, after, **counts):
    tracker = Follower(TrackingConfig(association="paper"), EFFICIENT)
    tracker.follow(*frame_of([before], 0, EYE))
    _, proposals = frame_of([after], 1, EYE, **counts)
    return tracker._tracks, observe(proposals, EYE)


@pytest.mark.parametrize(
    ("after", "points", "expected"),
    [
        (box(10, 0), 60, 0.0),
        (box(12, 0), 60, 2.0 * (1 - 2 / 6)),
        (box(10, 0), 90, 0.01 * 30),
        (box(10, 0, l=5.0), 60, 2.0 * (1 - 4 / 5) + 0.1 * 1.0),
    ],
)
def test_the_papers_cost_penalises_each_difference(after, points, expected):
    tracks, observations = candidates(box(10, 0), after, points=points)
    cost = PaperAssociation(TrackingConfig()).cost(tracks, observations, np.array([0]), np.array([0]))
    np.testing.assert_allclose(cost, expected, atol=1e-9)


def test_the_paper_rejects_above_its_threshold():
    near, far = box(11, 0), box(12, 0)
    match = PaperAssociation(TrackingConfig()).match
    assert len(match(*candidates(box(10, 0), near)).rows) == 1
    assert len(match(*candidates(box(10, 0), far)).rows) == 0


def test_outlines_hold_every_point_and_touch_one_each():
    yaw = 0.4
    T = np.array(
        [[np.cos(yaw), -np.sin(yaw), 0, 5], [np.sin(yaw), np.cos(yaw), 0, -3], [0, 0, 1, 1.7], [0, 0, 0, 1.0]]
    )
    frame, proposals = frame_of([box(10, 0, yaw=0.3), box(-4, 7)], 0, T)
    seen = observe(proposals, T)
    world = frame.points[:, :3] @ T[:3, :3].T + T[:3, 3]
    for i in range(2):
        along = world[proposals.members[proposals.offsets[i] : proposals.offsets[i + 1]], :2] @ DIRECTIONS
        np.testing.assert_allclose(seen.kdop[:, i], along.max(axis=0), atol=1e-4)
