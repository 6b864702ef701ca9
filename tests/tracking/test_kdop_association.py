"""The association by k-DOPs."""

import numpy as np
import pytest

from modt.classes import ObjectClass
from modt.observations import observe
from modt.tracking.kdop_association import KdopAssociation
from tests.tracking.tracking_scenes import EYE, Follower, box, frame_of, tracks_at

CAR = ObjectClass.CAR


def observed(boxes, points=60):
    return observe(frame_of(boxes, points=points)[1], EYE)


def matched(tracks, observations):
    """Pairs of a row and a proposal."""
    matches = KdopAssociation().match(tracks, observations)
    return sorted(zip(matches.rows.tolist(), matches.proposals.tolist(), strict=True))


def test_a_lost_track_does_not_take_the_proposal_of_a_track_that_is_expected_there():
    """Measured in deviations, the person is nearer to the lost track."""
    tracks, person = tracks_at([box(9.3, 0, 0.6, 0.6), box(11.5, 0, 0.6, 0.6)]), observed([box(10, 0, 0.6, 0.6)])
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
    tracks, part = tracks_at([box(10, 3)], points=3000), observed([box(x, 3, 0.3, 0.3, 0.3, z=-1.6)], points=6)
    assert matched(tracks, part) == pairs


def test_a_stationary_car_that_comes_into_view_has_no_speed():
    """Its rear stays in place while its centre moves ahead at 1 m/s and its front at 2 m/s."""
    follower = Follower()
    follower.run([[box(10 + 0.1 * i, 3, l=1.0 + 0.2 * i)] for i in range(15)], CAR)
    assert follower.tracks.id.tolist() == [0]
    assert follower.tracks.x[0, 3] < 0.5


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
