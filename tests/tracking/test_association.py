"""The associations by k-DOPs and of the paper, and the assignment that both use."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal
from scipy.optimize import linear_sum_assignment

from modt.classes import ObjectClass
from modt.geometry.kernels import assign
from modt.observations import observe
from modt.tracking.kdop_association import KdopAssociation
from modt.tracking.paper_association import PaperAssociation
from modt.tracking.tuning import PaperAssociationTuning
from tests.tracking.tracking_scenes import EYE, Follower, box, frame_of, tracks_at


def assigned(cost, limit):
    """Rows and columns that assign keeps of a dense matrix, of the pairs below the limit."""
    rows, columns = np.nonzero(cost < limit)
    kept = assign(rows, columns, cost[rows, columns], limit)
    rows = rows[kept]
    columns = columns[kept]
    assert len(set(rows)) == len(set(columns)) == len(kept)
    return rows, columns


@given(st.integers(0, 12), st.integers(0, 12), st.floats(0.5, 8), st.integers(0, 2**16))
def test_the_sparse_assignment_is_the_dense_one(n, k, limit, seed):
    cost = np.random.default_rng(seed).uniform(0, 8, (n, k))
    i, j = linear_sum_assignment(np.minimum(cost, limit))
    real = cost[i, j] < limit
    rows, columns = assigned(cost, limit)
    assert_array_equal(rows, i[real])
    assert_array_equal(columns, j[real])


CAR = ObjectClass.CAR


def observed(boxes, points=60):
    return observe(frame_of(boxes, points=points)[1], EYE)


def matched(tracks, observations):
    """Pairs of a row and a proposal."""
    matches = KdopAssociation().match(tracks, observations)
    return sorted(zip(matches.rows.tolist(), matches.proposals.tolist(), strict=True))


def test_a_lost_track_does_not_take_the_proposal_of_a_track_that_is_expected_there():
    """Measured in deviations, the person is nearer to the lost track."""
    tracks = tracks_at([box(9.3, 0, 0.6, 0.6), box(11.5, 0, 0.6, 0.6)])
    person = observed([box(10, 0, 0.6, 0.6)])
    tracks.P[:, :2, :2] = np.eye(2) * np.array([0.1, 9.0])[:, None, None]
    assert matched(tracks, person) == [(0, 0)]


@pytest.mark.parametrize(
    ("x", "columns", "pairs"), [(10.1, {}, [(0, 0)]), (11.4, {}, []), (12.0, {"P": 4 * np.eye(4)}, [(0, 0)])]
)
def test_a_pair_further_apart_than_the_filter_is_uncertain_is_not_matched(x, columns, pairs):
    assert matched(tracks_at([box(10, 0, 0.6, 0.6)], **columns), observed([box(x, 0, 0.6, 0.6)])) == pairs


@pytest.mark.parametrize(("x", "pairs"), [(9.0, [(0, 0)]), (7.4, [])])
def test_what_changed_its_shape_is_matched_by_coverage(x, pairs):
    """A car of which most disappeared costs more than a pair may."""
    tracks = tracks_at([box(10, 3)], points=3000)
    part = observed([box(x, 3, 0.3, 0.3, 0.3, z=-1.6)], points=6)
    assert matched(tracks, part) == pairs


def test_a_stationary_car_that_comes_into_view_has_no_speed():
    """Its rear stays in place while its centre moves ahead at 1 m/s and its front at 2 m/s."""
    follower = Follower()
    follower.run([[box(10 + 0.1 * i, 3, l=1.0 + 0.2 * i)] for i in range(15)], CAR)
    assert follower.tracks.id.tolist() == [0]
    assert follower.tracks.x[0, 3] < 0.5


def test_what_is_seen_through_a_gap_says_little_about_the_speed_of_a_car():
    """Both ends of what is seen are those of the gap, and stay, while the car drives on."""
    follower = Follower()
    follower.run([[box(20, 0.5 * k - 6, 1.6, 4.3)] for k in range(11)], CAR, points=400)
    assert follower.tracks.velocity[0] == pytest.approx([0, 5], abs=0.3)
    for k in range(11, 16):
        follower.follow(*frame_of([box(20, 0.5, 1.6, 1.2)], k, points=100))
        error = follower.tracks.velocity[0] - [0, 5]
        assert error @ np.linalg.solve(follower.tracks.velocity_covariance[0], error) < 10


def test_two_cars_in_a_row_stay_two():
    follower = Follower()
    for points in ((80, 40), (40, 80), (80, 40)):
        follower.run([[box(10, 4), box(15.2, 4)]] * 3, CAR, points=points)
        assert follower.tracks.id[follower.tracks.proposal.argsort()].tolist() == [0, 1]


def test_a_lost_track_is_matched_along_its_prediction():
    follower = Follower()
    follower.run([[box(10 + 0.8 * i, 0)] if i not in (8, 9, 10) else [] for i in range(13)], CAR)
    assert follower.tracks.id.tolist() == [0]
    assert follower.tracks.missed[0] == 0


def pair(before, after, points=60):
    """A track at one box, and the observation of another; their centroids are the centres of the boxes."""
    tracks = tracks_at([before])
    observations = observe(frame_of([after], points=points)[1], EYE)
    tracks.x[:, :2] = tracks.box[:, :2]
    return tracks, replace(observations, centroid=observations.box[:, :2])


def cost(before, after, points=60):
    """Cost of such a pair."""
    zero = np.array([0])
    return PaperAssociation().cost(*pair(before, after, points), zero, zero)[0]


@pytest.mark.parametrize(
    ("after", "points", "expected"),
    [
        (box(10, 0), 60, -0.01 - 0.3),
        (box(12, 0), 60, 2.0 * (1 - 2 / 6) - 0.01 - 0.3),
        (box(10, 0), 90, -0.01 * 2 / 3 - 0.3),
        (box(10, 0, l=5.0), 60, 2.0 * (1 - 4 / 5) - 0.01 - 0.1 * (2 + 4 / 5)),
    ],
)
def test_likenesses_are_rewarded(after, points, expected):
    assert cost(box(10, 0), after, points) == pytest.approx(expected, abs=1e-9)


@given(st.floats(0.0, 3.0), st.floats(0.3, 5.0), st.integers(20, 300))
def test_no_pair_costs_less_than_one_of_equals(shift, length, points):
    assert cost(box(10, 0), box(10 + shift, 0, l=length), points) >= cost(box(10, 0), box(10, 0)) - 1e-9


@pytest.mark.parametrize(("x", "t_da", "n"), [(11, 0.95, 1), (12, 0.95, 0), (12, 2.0, 1)])
def test_pairs_above_the_threshold_are_not_matched(x, t_da, n):
    association = PaperAssociation(PaperAssociationTuning(max_cost=t_da))
    assert len(association.match(*pair(box(10, 0), box(x, 0))).rows) == n


def test_the_last_box_is_compared_about_its_centroid_where_the_filter_expects_it():
    """Boxes of one length at one centroid overlap wholly, wherever their middles are."""
    tracks, observations = pair(box(10, 0), box(12, 0))
    tracks.x[0, 0] += 2.0
    tracks.box[0, :2] += 3.0
    matches = PaperAssociation().match(tracks, observations)
    assert matches.rows.tolist() == [0]
    assert_allclose(matches.position, observations.centroid)


def test_pairs_above_the_threshold_compete():
    """Crosswise both tracks cost least together, one pair of them too much."""
    tracks = tracks_at([box(10, 0)] * 2)
    observations = observe(frame_of([box(10, 0)] * 2)[1], EYE)
    association = PaperAssociation(PaperAssociationTuning(max_cost=0.3))
    association.cost = lambda *_: np.array([0.1, 0.4, 0.2, 0.9])
    assert association.match(tracks, observations).rows.tolist() == [1]
