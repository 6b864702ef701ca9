"""Parts of a car, or of background that may be one, are merged where its track knows it whole."""

from dataclasses import replace

import numpy as np
import pytest

from modt.classes import ObjectClass
from modt.config import TrackingConfig
from modt.geometry import inverse, se3, transform_boxes
from modt.geometry.kdop import DIRECTIONS
from modt.placement import Placement
from modt.tracking.regrouping import Regrouping
from tests.tracking.tracking_scenes import (
    EYE,
    Follower,
    associated,
    box,
    driving,
    frame_of,
    owner_of_points,
    tracks_at,
)

BACKGROUND, CAR, PEDESTRIAN = ObjectClass.BACKGROUND, ObjectClass.CAR, ObjectClass.PEDESTRIAN
WHOLE, REAR, FRONT = (box(x, 3, length, 1.8, 1.5) for x, length in ((10, 4.2), (8.6, 1.4), (11.1, 2.0)))
AHEAD = box(15, 3, 4.2, 1.8, 1.5)
POINTS = 80


def merging(tracks, frame):
    """The frame after merging."""
    return Regrouping().regroup(tracks, frame, Placement(EYE))


def frame_at_rest(tracks, boxes, *rows):
    """A frame whose first proposals are matched with the rows, and measure that these did not move."""
    frame = associated(frame_of(boxes, points=POINTS)[1], rows)
    frame.matches.position[:] = tracks.x[list(rows), :2]
    return frame


def merged(tracks, boxes, rows):
    """Original proposals of each one after merging, and the frame; the first are matched with the rows."""
    after, n = merging(tracks, frame_at_rest(tracks, boxes, *rows)), len(boxes)
    label = after.proposals.label(n * POINTS)
    assert sorted(after.proposals.members) == list(range(n * POINTS))
    per_box = label.reshape(n, POINTS)
    assert (per_box == per_box[:, :1]).all()
    groups = [np.flatnonzero(per_box[:, 0] == k).tolist() for k in range(len(after.proposals))]
    return groups, after


def test_the_parts_of_a_car_become_one_proposal():
    groups, after = merged(tracks_at([WHOLE], CAR), [REAR, FRONT], [0])
    assert groups == [[0, 1]]
    np.testing.assert_allclose(after.proposals.box[0], WHOLE, atol=0.05)
    np.testing.assert_allclose(after.observations.box[0], WHOLE, atol=0.05)
    assert (after.matches.rows.tolist(), after.matches.proposals.tolist()) == ([0], [0])


def test_the_match_of_a_part_is_dropped_and_proposals_are_renumbered():
    tracks = tracks_at([WHOLE, FRONT, box(30, 0)], CAR)
    groups, after = merged(tracks, [REAR, FRONT, box(30, 0)], [0, 1, 2])
    assert groups == [[0, 1], [2]]
    assert dict(zip(after.matches.rows.tolist(), after.matches.proposals.tolist(), strict=True)) == {0: 0, 2: 1}


@pytest.mark.parametrize(
    ("object_class", "columns", "why"),
    [
        (PEDESTRIAN, {}, "it is no car"),
        (BACKGROUND, {"hits": 3}, "it was seen too few times"),
        (CAR, {"hits": 3}, "it was seen too few times"),
    ],
)
def test_only_established_cars_merge(object_class, columns, why):
    groups, _ = merged(tracks_at([WHOLE], object_class, **columns), [REAR, FRONT], [0])
    assert groups == [[0], [1]], why


@pytest.mark.parametrize(
    ("own", "part", "why"),
    [
        (REAR, box(13.0, 3, 1.5, 1.8, 1.5), "it lies ahead of the car"),
        (REAR, box(11.1, 4.2, 2.0, 1.8, 1.5), "it reaches beyond its side"),
        (FRONT, box(13.0, 3, 2.0, 1.8, 1.5), "most of it lies ahead, though both are no longer than the car"),
        (REAR, box(11.65, 3, 2.6, 1.8, 1.5), "both are longer than the car, though most of it lies within"),
    ],
)
def test_what_exceeds_the_known_extent_is_no_part(own, part, why):
    tracks = tracks_at([WHOLE], CAR)
    assert len(merging(tracks, frame_at_rest(tracks, [own, part], 0)).proposals) == 2, why


@pytest.mark.parametrize(
    ("object_class", "groups"),
    [(PEDESTRIAN, [[0], [1]]), (ObjectClass.CYCLIST, [[0], [1]]), (BACKGROUND, [[0, 1]])],
)
def test_a_person_is_no_part(object_class, groups):
    tracks = tracks_at([WHOLE, FRONT], CAR, object_class)
    assert merged(tracks, [REAR, FRONT], [0, 1])[0] == groups


@pytest.mark.parametrize(("length_m", "groups"), [(4.2, [[0, 1]]), (7.0, [[0], [1]])])
def test_background_no_longer_than_a_car_is_made_whole(length_m, groups):
    assert merged(tracks_at([box(10, 3, length_m, 1.8, 1.5)]), [REAR, FRONT], [0])[0] == groups


@pytest.mark.parametrize(
    ("classes", "groups"),
    [
        ((BACKGROUND, BACKGROUND), [[0, 1]]),
        ((BACKGROUND, CAR), [[0], [1]]),
        ((BACKGROUND, PEDESTRIAN), [[0], [1]]),
    ],
)
def test_background_takes_from_younger_background_alone(classes, groups):
    assert merged(tracks_at([WHOLE, FRONT], *classes), [REAR, FRONT], [0, 1])[0] == groups


def test_background_takes_nothing_from_what_is_older():
    assert merged(tracks_at([FRONT, WHOLE]), [FRONT, REAR], [0, 1])[0] == [[0], [1]]


@pytest.mark.parametrize(("object_class", "groups"), [(CAR, [[0, 1]]), (BACKGROUND, [[0], [1]])])
def test_what_may_be_a_person_becomes_a_part_of_known_cars_alone(object_class, groups):
    part = box(11.1, 3, 0.6, 0.6, 1.5)
    assert merged(tracks_at([WHOLE], object_class), [REAR, part], [0])[0] == groups


def test_a_car_takes_all_its_parts():
    lorry = box(10, 3, 9.0, 1.8, 1.5)
    parts = [box(7.0, 3, 2.0, 1.8, 1.5), box(9.4, 3, 2.0, 1.8, 1.5), box(12.5, 3, 3.0, 1.8, 1.5)]
    tracks = tracks_at([lorry], CAR)
    assert len(merging(tracks, frame_at_rest(tracks, parts, 0)).proposals) == 1


def two_cars(ahead_m=0.0, behind_m=0.0):
    """An older car whose known extent is longer ahead, and a younger one's, longer behind."""
    tracks = tracks_at([WHOLE, AHEAD], CAR, CAR)
    tracks.envelope[0] += np.maximum(DIRECTIONS[0], 0) * ahead_m
    tracks.envelope[1] += np.maximum(-DIRECTIONS[0], 0) * behind_m
    return tracks


def test_the_proposal_of_an_older_car_is_no_part():
    assert merged(two_cars(behind_m=5.5), [WHOLE, AHEAD], [0, 1])[0] == [[0], [1]]


def test_the_proposal_of_a_younger_car_is_a_part():
    """The younger track then has none."""
    groups, after = merged(two_cars(ahead_m=6.5), [WHOLE, AHEAD], [0, 1])
    assert groups == [[0, 1]]
    assert after.matches.rows.tolist() == [0]


def test_a_part_of_two_cars_goes_to_the_older():
    part = box(12.5, 3, 0.5, 1.8, 1.5)
    assert merged(two_cars(ahead_m=3.5, behind_m=3.5), [WHOLE, AHEAD, part], [0, 1])[0] == [[0, 2], [1]]
    assert merged(two_cars(behind_m=3.5), [WHOLE, AHEAD, part], [0, 1])[0] == [[0], [1, 2]]


def test_a_proposal_that_gains_a_part_is_no_part_itself():
    near, far = box(14.2, 3, 2.6, 1.8, 1.5), box(16.4, 3, 1.3, 1.8, 1.5)
    tracks = two_cars(ahead_m=3.5)
    after = merging(tracks, frame_at_rest(tracks, [WHOLE, near, far], 0, 1))
    assert after.proposals.count.tolist() == [POINTS, 2 * POINTS]


def test_the_reflectance_is_that_of_the_matched_proposal():
    tracks = tracks_at([WHOLE], CAR)
    frame = frame_at_rest(tracks, [FRONT, REAR], 0)
    reflectance = np.arange(10.0).reshape(2, 5)
    after = merging(tracks, replace(frame, proposals=replace(frame.proposals, reflectance=reflectance)))
    np.testing.assert_array_equal(after.proposals.reflectance, reflectance[:1])


def test_a_frame_without_parts_is_returned_as_it_is():
    frame = associated(frame_of([WHOLE, AHEAD])[1], [0])
    assert merging(tracks_at([WHOLE], CAR), frame) is frame


KNOWN = 6
"""Frames in which the car is seen whole."""


def follow(follower, boxes, i, pose=lambda i: EYE, classes=(CAR,)):
    """Follow boxes that stand where frame 0 has them; id of the track of each of them."""
    T = pose(i)
    frame, proposals = frame_of(transform_boxes(inverse(T) @ pose(0), np.array(boxes)), i, T, points=POINTS)
    follower.follow(frame, proposals)
    follower.classify(*classes)
    owner = owner_of_points(follower.tracks, follower.proposals, len(frame.points)).reshape(len(boxes), POINTS)
    assert (owner == owner[:, :1]).all()
    return owner[:, 0].tolist()


@pytest.mark.parametrize("pose", [lambda i: EYE, driving], ids=["stationary", "driving"])
def test_a_car_in_two_parts_keeps_its_track_and_its_box(pose):
    follower = Follower()
    for i in range(KNOWN):
        follow(follower, [WHOLE], i, pose)
    for i in range(KNOWN, KNOWN + 8):
        assert follow(follower, [REAR, FRONT], i, pose) == [0, 0]
        assert len(follower.proposals) == 1
    np.testing.assert_allclose(follower.proposals.box[0, 3:6], WHOLE[3:6], atol=0.05)
    T = se3(pose(0)[:3, :3], np.zeros(3))  # the world begins at a pose that is far from its origin
    np.testing.assert_allclose(follower.tracks.box[0], transform_boxes(T, np.array([WHOLE]))[0], atol=0.05)


def test_without_extensions_the_tracker_takes_proposals_as_they_are():
    follower = Follower(TrackingConfig(extensions="none"))
    for i in range(KNOWN):
        follow(follower, [WHOLE], i)
    follow(follower, [REAR, FRONT], KNOWN)
    assert len(follower.proposals) == 2


@pytest.mark.parametrize(
    ("object_class", "length_m", "known_m"),
    [
        (CAR, 5.8, 5.8),
        (CAR, 6.4, 5.0),  # longer than any car
        (BACKGROUND, 6.4, 6.4),
    ],
)
def test_the_known_extent_grows_up_to_the_size_of_the_class(object_class, length_m, known_m):
    follower = Follower()
    for i in range(KNOWN):
        follow(follower, [box(10, 3, 5.0)], i, classes=(object_class,))
    frame, proposals = frame_of([box(10, 3, length_m)], KNOWN, points=POINTS)
    follower.follow(frame, proposals)
    envelope = follower.tracks.envelope[0]
    assert envelope[0] + envelope[4] == pytest.approx(known_m, abs=0.25)


def test_what_surrounds_the_part_last_seen_and_lies_outside_the_known_extent_is_no_part():
    tracks, strip = tracks_at([WHOLE], CAR), box(12, 3, 0.2, 1.8, 1.5)
    tracks.kdop[:] = tracks_at([strip]).kdop
    assert len(merging(tracks, frame_at_rest(tracks, [strip, box(12.7, 3, 1.5, 1.8, 1.5)], 0)).proposals) == 2
