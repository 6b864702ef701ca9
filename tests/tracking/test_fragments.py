"""The larger part of an object goes to its most senior track; one seen three times does not join parts."""

import numpy as np
import pytest

from modt.classes import ObjectClass
from modt.geometry.kdop import DIRECTIONS
from modt.placement import Placement
from modt.tracking.regrouping import Regrouping
from modt.types import NONE
from tests.tracking.tracking_scenes import EYE, associated, box, frame_of, tracks_at

BACKGROUND, CAR, PEDESTRIAN = ObjectClass.BACKGROUND, ObjectClass.CAR, ObjectClass.PEDESTRIAN


WHOLE, REAR, FRONT = box(12, 4), box(11.0, 4, l=1.9), box(13.3, 4, l=1.3)
POST, PERSON = box(12, 4, 0.5, 0.5, 1.7), box(12.3, 4, 0.6, 0.6, 1.7)


def ranked(boxes, *classes, **columns):
    """Tracks of which the first has had most points, and so on."""
    tracks = tracks_at(boxes, *classes, **{"hits": 3, **columns})
    tracks.points[:] = 100 * np.arange(len(tracks), 0, -1)
    return tracks


def reunited(tracks, boxes, rows, points):
    """Proposal of each track after reunite, where the first proposals were matched with the rows given."""
    frame = associated(frame_of(boxes, points=points)[1], rows)
    matches = Regrouping().regroup(tracks, frame, Placement(EYE)).matches
    assert len(set(matches.rows.tolist())) == len(matches.rows)
    assert len(set(matches.proposals.tolist())) == len(matches.proposals)
    proposal = np.full(len(tracks), NONE)
    proposal[matches.rows] = matches.proposals
    return proposal.tolist(), matches


def test_the_senior_track_takes_the_larger_part():
    tracks = ranked([WHOLE, FRONT], CAR, CAR)
    assert reunited(tracks, [REAR, FRONT], [1, 0], (40, 80))[0] == [1, 0]  # it is matched with the larger already
    assert reunited(tracks, [REAR, FRONT], [0, 1], (40, 80))[0] == [1, 0]
    assert reunited(tracks, [REAR, FRONT], [0, 1], (80, 40))[0] == [0, 1]


def test_the_track_with_more_points_in_its_life_is_the_senior_one():
    tracks = ranked([WHOLE, FRONT], CAR, CAR)
    for points, hits, expected in (((70, 90), (2, 2), [0, 1]), ((70, 90), (3, 2), [1, 0])):
        tracks.points[:], tracks.hits[:] = points, hits
        assert reunited(tracks, [REAR, FRONT], [0, 1], (40, 80))[0] == expected


def test_the_most_senior_of_three_is_served_first():
    tracks = ranked([WHOLE, WHOLE, FRONT], CAR, CAR, CAR)
    tracks.points[:] = 50, 500, 5
    assert reunited(tracks, [FRONT], [2], 80)[0] == [NONE, 0, NONE]


def test_a_lost_track_takes_the_part_and_its_former_owner_is_lost():
    tracks = ranked([WHOLE, FRONT], CAR, CAR)
    proposal, matches = reunited(tracks, [FRONT], [1], 40)
    assert proposal == [0, NONE]
    np.testing.assert_allclose(matches.position[0], tracks.x[0, :2])  # a part measures nothing
    assert matches.covariance[0, 0, 0] >= 100


def test_a_part_without_a_track_is_taken():
    assert reunited(ranked([WHOLE], CAR), [REAR, FRONT], [0], (40, 80))[0] == [1]


@pytest.mark.parametrize(
    ("senior", "junior", "boxes", "columns", "why"),
    [
        (WHOLE, box(17.4, 4), [REAR, box(17.4, 4)], {}, "the parts are longer than a car"),
        (WHOLE, FRONT, [REAR, FRONT], {"hits": 1}, "the senior track was seen once"),
    ],
)
def test_what_is_no_fragment_stays_with_its_track(senior, junior, boxes, columns, why):
    tracks = ranked([senior, junior], CAR, CAR, **columns)
    assert reunited(tracks, boxes, [0, 1], (40, 80))[0] == [0, 1], why


def test_a_part_around_the_senior_track_is_taken():
    """The senior track knows a fragment only; the whole came to a junior one."""
    assert reunited(ranked([FRONT, WHOLE], CAR, CAR), [WHOLE], [1], 80)[0] == [0, NONE]


@pytest.mark.parametrize(("length_m", "swapped"), [(1.5, True), (3.5, False)])
def test_parts_that_are_longer_than_their_class_together_are_not_one_object(length_m, swapped):
    """Both lie within the known extent, which once was that of a merged object."""
    part = box(14.2 + length_m / 2, 4, length_m)
    tracks = ranked([WHOLE, part], CAR, CAR)
    tracks.envelope[0] += 6 * np.maximum(DIRECTIONS[0], 0)
    assert (reunited(tracks, [REAR, part], [0, 1], (40, 80))[0] == [1, 0]) == swapped


@pytest.mark.parametrize(
    ("senior_class", "junior_class", "swapped"),
    [
        (CAR, CAR, True),
        (BACKGROUND, CAR, True),  # background and cars are easily confused
        (CAR, PEDESTRIAN, False),
        (BACKGROUND, PEDESTRIAN, False),
    ],
)
def test_parts_of_different_classes_are_not_one_object(senior_class, junior_class, swapped):
    tracks = ranked([WHOLE, FRONT], senior_class, junior_class)
    assert (reunited(tracks, [REAR, FRONT], [0, 1], (40, 80))[0] == [1, 0]) == swapped


def test_an_empty_frame_is_no_fragment():
    assert reunited(tracks_at([WHOLE], CAR), [], [], 0)[0] == [NONE]
