"""Parts of a car, or of background that may be one, are merged where its track knows it whole."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from modt.classes import ObjectClass
from modt.config import TrackingConfig
from modt.geometry import inverse, se3, transform_boxes
from modt.geometry.kdop import DIRECTIONS
from tests.tracking.tracking_scenes import (
    EYE,
    Follower,
    associated,
    box,
    driving,
    frame_of,
    owner_of_points,
    regrouped,
    tracks_at,
)

BACKGROUND, CAR, PEDESTRIAN, CYCLIST = ObjectClass


def of_car(x, length):
    """Box as wide and high as a car."""
    return box(x, 3, length, 1.8, 1.5)


WHOLE, REAR, FRONT = of_car(10, 4.2), of_car(8.6, 1.4), of_car(11.1, 2.0)
AHEAD = of_car(15, 4.2)
SLIM = box(11.1, 3, 0.6, 0.6, 1.5)
TALLER = box(11.1, 3, 0.6, 0.6, 1.8, z=-0.85)
POINTS = 80


def frame_at_rest(tracks, boxes, *rows):
    """A frame whose first proposals are matched with the rows, and measure that these did not move."""
    frame = associated(frame_of(boxes, points=POINTS)[1], rows)
    frame.matches.position[:] = tracks.x[list(rows), :2]
    return frame


def merged(tracks, boxes, rows):
    """Original proposals of each one after merging, and the frame; the first are matched with the rows."""
    after = regrouped(tracks, frame_at_rest(tracks, boxes, *rows))
    n = len(boxes)
    label = after.proposals.label(n * POINTS)
    per_box = label.reshape(n, POINTS)
    assert (per_box == per_box[:, :1]).all()
    groups = [np.flatnonzero(per_box[:, 0] == k).tolist() for k in range(len(after.proposals))]
    return groups, after


@pytest.mark.parametrize(
    ("known", "classes", "seen", "columns", "is_part"),
    [
        ([WHOLE], [PEDESTRIAN], [REAR, FRONT], {}, False),
        ([WHOLE], [CAR], [REAR, FRONT], {"hits": 3}, False),  # seen too few times
        ([WHOLE], [BACKGROUND], [REAR, FRONT], {"hits": 3}, False),
        ([WHOLE], [CAR], [REAR, of_car(13.0, 1.5)], {}, False),  # ahead of the car
        ([WHOLE], [CAR], [REAR, box(11.1, 4.2, 2.0, 1.8, 1.5)], {}, False),  # reaches beyond its side
        ([WHOLE], [CAR], [FRONT, of_car(13.0, 2.0)], {}, False),  # both as long as the car, most ahead
        ([WHOLE], [CAR], [REAR, of_car(11.65, 2.6)], {}, False),  # most within, both longer than the car
        ([WHOLE, FRONT], [CAR, PEDESTRIAN], [REAR, FRONT], {}, False),
        ([WHOLE, FRONT], [CAR, CYCLIST], [REAR, FRONT], {}, False),
        ([WHOLE, FRONT], [CAR, BACKGROUND], [REAR, FRONT], {}, True),
        ([WHOLE], [BACKGROUND], [REAR, FRONT], {}, True),
        ([of_car(10, 7.0)], [BACKGROUND], [REAR, FRONT], {}, False),  # longer than a car
        ([WHOLE, FRONT], [BACKGROUND, BACKGROUND], [REAR, FRONT], {}, True),
        ([WHOLE, FRONT], [BACKGROUND, CAR], [REAR, FRONT], {}, False),
        ([WHOLE, FRONT], [BACKGROUND, PEDESTRIAN], [REAR, FRONT], {}, False),
        ([FRONT, WHOLE], [BACKGROUND, BACKGROUND], [FRONT, REAR], {}, False),  # the other is older
        ([WHOLE], [CAR], [REAR, SLIM], {}, True),  # may be a person
        ([WHOLE], [BACKGROUND], [REAR, SLIM], {}, False),
        ([WHOLE], [CAR], [REAR, TALLER], {}, False),  # stands in an open door
    ],
)
def test_what_is_a_part(known, classes, seen, columns, is_part):
    groups, _ = merged(tracks_at(known, *classes, **columns), seen, range(len(known)))
    assert groups == ([[0, 1]] if is_part else [[0], [1]])


@pytest.mark.parametrize(("points", "is_part"), [(19, True), (20, False)])
def test_few_points_above_a_car_are_a_part_of_it(points, is_part):
    tracks = tracks_at([WHOLE], CAR)
    after = regrouped(tracks, associated(frame_of([REAR, TALLER], points=[POINTS, points])[1], [0]))
    assert len(after.proposals) == (1 if is_part else 2)


BICYCLE = box(10, 3, 1.8, 0.6, 1.7)
RIDER = box(10.2, 3, 1.2, 0.6, 1.7)
WHEEL = box(9.25, 3, 0.3, 0.2, 0.6, z=-1.6)
SOMEONE = box(9.2, 3, 0.4, 0.4, 1.7)


@pytest.mark.parametrize(
    ("known", "classes", "seen", "hits", "is_part"),
    [
        ([BICYCLE], [CYCLIST], [RIDER, WHEEL], [10], True),
        ([BICYCLE], [PEDESTRIAN], [RIDER, WHEEL], [10], False),
        ([BICYCLE], [CYCLIST], [RIDER, SOMEONE], [10], False),  # may be a person
        ([BICYCLE, WHEEL], [CYCLIST, BACKGROUND], [RIDER, WHEEL], [10, 5], True),
        ([BICYCLE, WHEEL], [CYCLIST, PEDESTRIAN], [RIDER, WHEEL], [10, 5], False),
        ([RIDER], [CYCLIST], [RIDER, WHEEL], [10], True),  # comes into view
        ([RIDER, WHEEL], [CYCLIST, BACKGROUND], [RIDER, WHEEL], [10, 5], False),  # an established track
        ([RIDER], [CYCLIST], [RIDER, box(8.7, 3, 0.3, 0.2, 0.6, z=-1.6)], [10], False),  # 2.25 m together
    ],
)
def test_a_wheel_is_a_part_of_its_cyclist(known, classes, seen, hits, is_part):
    tracks = tracks_at(known, *classes, hits=hits)
    tracks.points[:] = POINTS * np.arange(len(known), 0, -1)
    frame = associated(frame_of(seen, points=[POINTS, POINTS - 1])[1], range(len(known)))
    after = regrouped(tracks, frame)
    assert len(after.proposals) == (1 if is_part else 2)


NEAR_END = of_car(10.5, 2.0)
NEXT = of_car(12.1, 0.8)


@pytest.mark.parametrize(
    ("known", "classes", "seen", "hits", "is_part"),
    [
        ([NEAR_END], [CAR], [NEAR_END, NEXT], [10], True),
        ([NEAR_END], [BACKGROUND], [NEAR_END, NEXT], [10], False),
        ([NEAR_END], [CAR], [NEAR_END, of_car(12.6, 0.8)], [10], False),  # a gap of .7 m
        ([NEAR_END], [CAR], [NEAR_END, of_car(13.6, 3.8)], [10], False),  # 6 m together
        ([WHOLE], [CAR], [NEAR_END, of_car(13.5, 3.6)], [10], False),  # the car is known to be longer
        ([NEAR_END], [CAR], [NEAR_END, box(12.1, 3, 0.6, 0.6, 1.5)], [10], False),  # may be a person
        ([NEAR_END, NEXT], [CAR, BACKGROUND], [NEAR_END, NEXT], [10, 2], False),  # as many points as the car shows
        ([NEAR_END, NEXT], [CAR, PEDESTRIAN], [NEAR_END, NEXT], [10, 2], False),
        ([NEAR_END, NEXT], [CAR, BACKGROUND], [NEAR_END, NEXT], [10, 4], False),  # an established track
    ],
)
def test_a_part_that_comes_into_view_lies_beside_what_is_known_of_a_car(known, classes, seen, hits, is_part):
    groups, _ = merged(tracks_at(known, *classes, hits=hits), seen, range(len(known)))
    assert groups == ([[0, 1]] if is_part else [[0], [1]])


def test_a_car_takes_the_proposal_that_covers_half_of_it_from_a_fragment():
    tracks = tracks_at([of_car(10, 2.0), of_car(11.9, 0.6)], CAR, BACKGROUND, hits=[10, 2])
    seen = [of_car(11.5, 3.0)]  # matched with the fragment
    assert regrouped(tracks, frame_at_rest(tracks, seen, 1)).matches.rows.tolist() == [0]


def test_a_car_takes_all_its_parts():
    parts = [of_car(7.0, 2.0), of_car(9.4, 2.0), of_car(12.5, 3.0)]
    assert merged(tracks_at([of_car(10, 9.0)], CAR), parts, [0])[0] == [[0, 1, 2]]


@pytest.mark.parametrize(
    ("ahead_m", "behind_m", "seen", "groups"),
    [
        (0.0, 5.5, [WHOLE, AHEAD], [[0], [1]]),  # the proposal of an older car is no part
        (6.5, 0.0, [WHOLE, AHEAD], [[0, 1]]),
        (3.5, 3.5, [WHOLE, AHEAD, of_car(12.5, 0.5)], [[0, 2], [1]]),  # both know it: the older takes it
        (0.0, 3.5, [WHOLE, AHEAD, of_car(12.5, 0.5)], [[0], [1, 2]]),
        # the near one is a part of the older car, but for the one that it gains itself
        (3.5, 0.0, [WHOLE, of_car(14.2, 2.6), of_car(16.4, 1.3)], [[0], [1, 2]]),
    ],
)
def test_of_two_cars_the_older_takes_parts_and_proposals_of_the_younger(ahead_m, behind_m, seen, groups):
    """The known extent of the older car reaches further ahead, that of the younger one further behind."""
    tracks = tracks_at([WHOLE, AHEAD], CAR, CAR)
    tracks.envelope[0] += np.maximum(DIRECTIONS[0], 0) * ahead_m
    tracks.envelope[1] += np.maximum(-DIRECTIONS[0], 0) * behind_m
    assert merged(tracks, seen, [0, 1])[0] == groups


def test_the_reflectance_is_that_of_the_matched_proposal():
    tracks = tracks_at([WHOLE], CAR)
    reflectance = np.arange(10.0).reshape(2, 5)
    frame = frame_at_rest(tracks, [FRONT, REAR], 0)
    after = regrouped(tracks, frame._replace(proposals=replace(frame.proposals, reflectance=reflectance)))
    assert_array_equal(after.proposals.reflectance, reflectance[:1])


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
    assert_allclose(follower.proposals.box[0, 3:6], WHOLE[3:6], atol=0.05)
    T = se3(pose(0)[:3, :3], np.zeros(3))  # the world begins at a pose that is far from its origin
    assert_allclose(follower.tracks.box[0], transform_boxes(T, np.array([WHOLE]))[0], atol=0.05)


def test_a_car_that_passes_behind_a_pole_keeps_its_velocity():
    follower = Follower()
    worst_mps = 0.0
    for k in range(30):
        rear_m, front_m, pole_m = 0.8 * k, 0.8 * k + 4.2, 12.0
        ends = [rear_m, front_m]
        if rear_m + 0.6 < pole_m < front_m - 0.6:
            ends = [rear_m, pole_m - 0.2, pole_m + 0.2, front_m]
        parts = [box((a + b) / 2, 6, b - a, 1.8, 1.5) for a, b in zip(ends[::2], ends[1::2], strict=True)]
        follower.run([parts], CAR, points=100)
        if k > 8:
            worst_mps = max(worst_mps, np.hypot(*(follower.tracks.velocity[0] - [8.0, 0.0])))
    assert follower.tracks.id[0] == 0
    assert worst_mps < 1.0


def test_who_leaves_a_parked_car_is_a_track_of_his_own_once_apart():
    follower = Follower()
    for i in range(KNOWN):
        follow(follower, [WHOLE], i)
    own = []
    for i in range(KNOWN, KNOWN + 12):  # from within the flank to half a metre before it
        driver = box(10, 2.1 - 0.08 * (i - KNOWN), 0.6, 0.6, 1.5)
        own.append(follow(follower, [WHOLE, driver], i) != [0, 0])
    assert not own[0]
    assert own[-1]


def test_without_extensions_the_tracker_takes_proposals_as_they_are():
    follower = Follower(TrackingConfig(extensions="none"))
    for i in range(KNOWN):
        follow(follower, [WHOLE], i)
    follow(follower, [REAR, FRONT], KNOWN)
    assert len(follower.proposals) == 2


@pytest.mark.parametrize(
    ("object_class", "length_m", "known_m"),
    [(CAR, 5.8, 5.8), (CAR, 6.4, 5.0), (BACKGROUND, 6.4, 6.4)],  # no car is longer than 6 m
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
    tracks = tracks_at([WHOLE], CAR)
    strip = of_car(12, 0.2)
    tracks.kdop[:] = tracks_at([strip]).kdop
    assert len(regrouped(tracks, frame_at_rest(tracks, [strip, of_car(12.7, 1.5)], 0)).proposals) == 2
