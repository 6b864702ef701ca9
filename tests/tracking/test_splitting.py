"""Objects are split off larger proposals where their tracks expect them."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from modt.classes import ObjectClass
from modt.geometry import inverse, transform_boxes
from modt.geometry.kdop import DIRECTIONS
from tests.odometry.test_deskew import skewed
from tests.tracking.tracking_scenes import (
    EYE,
    Follower,
    associated,
    box,
    driving,
    frame_of,
    joined,
    owner_of_points,
    regrouped,
    tracks_at,
)

BACKGROUND = ObjectClass.BACKGROUND
CAR = ObjectClass.CAR
PEDESTRIAN = ObjectClass.PEDESTRIAN
WALL = box(12, 3.2, l=16.0, w=0.3, h=2.5, z=-0.5)


def person_at(x, y):
    return box(x, y, 0.6, 0.6, 1.7, z=-0.85)


PERSON = person_at(10, 2.5)
PERSON_POINTS = 80
WALL_POINTS = 400


def wall_with(*people, points=PERSON_POINTS, wall=WALL):
    """Proposals of people and a wall, all in one; the points of the wall come last."""
    counts = [*np.broadcast_to(points, len(people)), WALL_POINTS]
    return joined(frame_of([*people, wall], points=counts)[1], [range(len(people) + 1)])


def split(tracks, proposals, rows, matched=None):
    """The frame after splitting."""
    return regrouped(tracks, associated(proposals, rows, matched))


def tracks_of_person_and_wall(object_class=PEDESTRIAN, person=PERSON, **columns):
    tracks = tracks_at([person, WALL], object_class)
    tracks.points[:] = PERSON_POINTS, WALL_POINTS
    for column, value in columns.items():
        getattr(tracks, column)[0] = value
    return tracks


def test_the_points_of_a_person_are_split_off_a_wall_and_measure_its_position_alone():
    tracks = tracks_of_person_and_wall()
    after = split(tracks, wall_with(PERSON), rows=[1])
    assert after.proposals.count.tolist() == [WALL_POINTS, PERSON_POINTS]
    assert sorted(after.proposals.members[WALL_POINTS:]) == list(range(PERSON_POINTS))
    assert dict(zip(after.matches.rows.tolist(), after.matches.proposals.tolist(), strict=True)) == {0: 1, 1: 0}
    assert_allclose(after.proposals.box[1], PERSON, atol=0.05)
    assert_allclose(after.proposals.box[0, :6], WALL[:6], atol=0.05)
    order = after.matches.rows.argsort()
    assert_allclose(after.matches.position[order], tracks.x[:, :2], atol=0.05)
    assert (after.matches.covariance[order, 0, 0] >= [0.001, 100]).all()
    shift = after.matches.position[order][0] - tracks.x[0, :2]
    assert_allclose(after.observations.kdop[:, 1], tracks.predicted_kdops()[:, 0] + DIRECTIONS.T @ shift)
    assert (after.observations.bottom[1], after.observations.top[1]) == (tracks.bottom[0], tracks.top[0])


@pytest.mark.parametrize("step_m", [-0.12, 0.0, 0.12])
def test_a_piece_moves_its_track_along_the_wall(step_m):
    """The ends along the wall are free: nobody else is near them."""
    tracks = tracks_of_person_and_wall(person=person_at(10 - step_m, 2.5))
    after = split(tracks, wall_with(PERSON), rows=[1])
    position = after.matches.position[after.matches.rows == 0][0]
    assert position == pytest.approx([10.0, 2.5], abs=0.06)


def test_a_piece_within_a_large_thing_measures_nothing():
    """Returns of it reach the margin on every side."""
    tracks = tracks_of_person_and_wall()
    around = joined(
        frame_of([PERSON, box(10, 2.5, 3.0, 3.0, 1.6, z=-0.9)], points=[PERSON_POINTS, 4000])[1], [(0, 1)]
    )
    after = split(tracks, around, rows=[1])
    mine = after.matches.rows == 0
    assert_allclose(after.matches.position[mine], tracks.x[:1, :2], atol=0.02)
    assert after.matches.covariance[mine, 0, 0] > 0.05  # where nothing touches it 0.005


@pytest.mark.parametrize(
    ("rows", "matched", "why"),
    [
        ([0], [0], "its proposal is too long for a person"),
        ([0, 1], [1, 0], "its proposal is of few points"),
        ([0], [1], "its proposal is of few points"),
    ],
)
def test_a_person_splits_the_wall_though_a_proposal_was_matched(rows, matched, why):
    frame = frame_of([PERSON, WALL, box(10, 2.1, 0.1, 0.1, 0.4, z=-0.5)], points=[PERSON_POINTS, WALL_POINTS, 12])[1]
    tracks = tracks_of_person_and_wall()
    after = split(tracks, joined(frame, [(0, 1), (2,)]), rows=rows, matched=matched)
    own = after.matches.proposals[after.matches.rows == 0]
    assert after.proposals.count[own] == [PERSON_POINTS], why


def test_a_track_that_is_hardly_a_person_keeps_its_proposal():
    tracks = tracks_of_person_and_wall()
    tracks.posterior[0] = [0.6, 0.0, 0.4, 0.0]
    assert len(split(tracks, wall_with(PERSON), rows=[0]).proposals) == 1


def test_the_reflectance_of_a_piece_is_unknown():
    proposals = replace(wall_with(PERSON), reflectance=np.full((1, 5), 0.3))
    after = split(tracks_of_person_and_wall(), proposals, rows=[1])
    assert_array_equal(after.proposals.reflectance, [[0.3] * 5, [np.nan] * 5])


@pytest.mark.parametrize(
    ("object_class", "columns", "person", "points", "wall"),
    [
        (BACKGROUND, {}, PERSON, 80, WALL),  # a post
        (PEDESTRIAN, {"hits": 1}, PERSON, 80, WALL),  # seen once
        (PEDESTRIAN, {"missed": 1}, PERSON, 80, WALL),  # lost before
        (PEDESTRIAN, {}, PERSON, 12, WALL),  # too few points where it is expected
        (PEDESTRIAN, {}, box(10, 2.5, 0.6, 0.6, 0.9, z=-1.25), 80, box(12, 3, 16.0, 0.3, 0.9, z=-1.2)),  # lower
        (PEDESTRIAN, {}, person_at(10, -4), 80, WALL),  # in another place
        (PEDESTRIAN, {}, PERSON, 80, person_at(10, 2.6)),  # no longer than the track
    ],
)
def test_only_what_a_track_expects_is_split_off(object_class, columns, person, points, wall):
    tracks = tracks_of_person_and_wall(object_class, **columns)
    assert len(split(tracks, wall_with(person, points=points, wall=wall), rows=[1]).proposals) == 1


def test_a_matched_track_splits_nothing():
    proposals = joined(frame_of([PERSON, PERSON, WALL], points=[80, 80, 400])[1], [(0,), (1, 2)])
    assert len(split(tracks_of_person_and_wall(), proposals, rows=[0, 1]).proposals) == 2


DIAMOND = box(10, 2.5, 0.85, 0.85, 1.7, yaw=np.pi / 4, z=-0.85)


@pytest.mark.parametrize(
    ("person", "others"),
    [
        (PERSON, [box(10, 2.5, l=8.0, w=3.0, h=0.5, z=1.2)]),  # above the expected top
        (DIAMOND, [box(10.62, 3.12, 0.1, 0.1, 1.7, z=-0.85), WALL]),  # beyond a diagonal side
    ],
)
def test_points_beyond_the_expected_place_stay_with_the_rest(person, others):
    counts = [PERSON_POINTS, *[WALL_POINTS] * len(others)]
    proposals = joined(frame_of([person, *others], points=counts)[1], [range(len(counts))])
    after = split(tracks_of_person_and_wall(person=person), proposals, rows=[1]).proposals
    assert len(after) == 2
    assert set(after.members[after.offsets[1] :]).isdisjoint(range(PERSON_POINTS, PERSON_POINTS + WALL_POINTS))


def test_the_first_track_takes_what_two_expect():
    tracks = tracks_at([PERSON, PERSON, WALL], PEDESTRIAN, PEDESTRIAN)
    tracks.points[:] = PERSON_POINTS
    after = split(tracks, wall_with(PERSON), rows=[2])
    assert after.proposals.count.tolist() == [WALL_POINTS, PERSON_POINTS]
    assert dict(zip(after.matches.rows.tolist(), after.matches.proposals.tolist(), strict=True)) == {0: 1, 2: 0}


STEP_M = 0.14
TOUCH = 10
"""Speed of a pedestrian a frame, and the first frame in which the pedestrian touches the wall."""


def follow(follower, bodies, i, T=EYE, together=()):
    """Follow people and a wall; ids of the tracks of most points of each, and the shares of these points."""
    counts = [*[PERSON_POINTS] * (len(bodies) - 1), WALL_POINTS]
    frame, proposals = frame_of(transform_boxes(inverse(T), np.array(bodies)), i, T, points=counts)
    follower.follow(frame, joined(proposals, together) if together else proposals)
    follower.classify(*[PEDESTRIAN] * (len(bodies) - 1), BACKGROUND)
    owner = owner_of_points(follower.tracks, follower.proposals, len(frame.points))
    ids = []
    shares = []
    for own in np.split(owner, np.cumsum(counts)[:-1]):
        found, count = np.unique(own, return_counts=True)
        ids.append(int(found[count.argmax()]))
        shares.append(count.max() / len(own))
    return ids, shares


def walker(i, y=2.5):
    return person_at(8 + STEP_M * i, y)


@pytest.mark.parametrize("pose", [lambda i: EYE, driving], ids=["stationary", "driving"])
def test_a_pedestrian_who_touches_a_wall_keeps_the_track(pose):
    follower = Follower()
    for i in range(TOUCH + 8):
        bodies = transform_boxes(pose(0), np.array([walker(i), WALL]))
        together = [(0, 1)] if i in {TOUCH, TOUCH + 1, TOUCH + 4} else ()
        ids, _ = follow(follower, bodies, i, pose(i), together)
        assert ids == [0, 1]
        assert len(follower.proposals) == 2


@pytest.mark.parametrize(("wall_y", "together"), [(9.0, [(0, 1), (2,)]), (3.3, [(0, 1, 2)])])
def test_two_pedestrians_who_meet_keep_their_tracks(wall_y, together):
    """Also where they touch a wall: they share no point."""
    follower = Follower()
    wall = [12, wall_y, *WALL[2:]]
    for i in range(TOUCH + 12):
        bodies = [walker(i, y=2.0), person_at(12.2 - STEP_M * i, 2.85), wall]
        ids, shares = follow(follower, bodies, i, together=together if i in {14, 15} else ())
        assert ids == [0, 1, 2]
        assert min(shares) > 0.95


def test_a_piece_is_expected_where_the_head_saw_it_not_at_the_middle_of_the_wall():
    """A wall of 40 m is seen over a third of a sweep, in which the sensor moves by 0.7 m."""
    follower = Follower()
    wall = box(30, 6, l=40.0, w=0.3, h=2.5, z=-0.5)
    person = walker(86, y=5.4)
    for i in range(11):
        frame, proposals = skewed(np.array([person, wall]), i, 0.1, 20.0, 0.0, True)
        follower.follow(frame, joined(proposals, [(0, 1)]) if i == 10 else proposals)
        follower.classify(PEDESTRIAN, BACKGROUND)
    members = follower.proposals.members[follower.proposals.offsets[1] :]
    assert len(follower.proposals) == 2
    assert np.count_nonzero(members < 80) > 0.95 * 80
    assert_allclose(follower.tracks.x[0, :2], person[:2], atol=0.1)
    assert_allclose(follower.tracks.box[0, :2], person[:2], atol=0.1)


def test_the_piece_lies_where_the_filter_expects_its_track():
    """The track moved by half a metre since it was observed, for the second time."""
    tracks = tracks_of_person_and_wall(person=person_at(9.5, 2.5), hits=2)
    tracks.x[0, 0] += 0.5
    after = split(tracks, wall_with(PERSON), rows=[1])
    assert sorted(after.proposals.members[WALL_POINTS:]) == list(range(PERSON_POINTS))
