"""Somebody touches a wall, and is taken out of it again."""

import dataclasses
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from modt.tracking.carving import carved

from modt.classes import N_CLASSES, ObjectClass
from modt.config import TrackingConfig
from modt.geometry import inverse, rotation_zyx, se3, transform_boxes
from modt.tracking.splitting import AT_MOST, _Scene, _walks
from modt.tracking.states import EFFICIENT
from modt.tracking.track_table import TrackTable
from modt.types import NONE
from tests.odometry.test_deskew import skewed
from tests.tracking.tracking_scenes import Follower, box, frame_of

EYE = np.eye(4)
WALL = box(12, 3, l=16.0, w=0.3, h=2.5, z=-0.5)
PERSON_POINTS, WALL_POINTS = 80, 400
STEP_M = 0.14
MEET = 14
"""Frame by which somebody has walked so far that nobody takes them for a post."""


def still(i):
    return EYE


def driving(i):
    """Far from the origin of the world, and turning."""
    return se3(
        rotation_zyx(0.01, -0.02, 0.7 + 0.02 * i), np.array([458_000.0 + 0.3 * i, 5_430_000.0 + 0.2 * i, 120.0])
    )


def walker(i, y=2.5, height=1.7):
    return box(8 + STEP_M * i, y, 0.6, 0.6, height, z=height / 2 - 1.7)


def merged(frame, proposals, groups):
    """The same frame with proposals that are unions of others, given by their numbers."""
    rows = [np.concatenate([np.arange(*proposals.offsets[k : k + 2]) for k in group]) for group in groups]
    xyz = [proposals.coordinates[:, r].T.astype(np.float64) for r in rows]
    low, high = ([f(p, axis=0) for p in xyz] for f in (np.min, np.max))
    boxes = [[*(a + b) / 2, *(b - a), 0.0] for a, b in zip(low, high, strict=True)]
    return frame, dataclasses.replace(
        proposals,
        members=proposals.members[np.concatenate(rows)],
        offsets=np.cumsum([0, *map(len, rows)]),
        coordinates=proposals.coordinates[:, np.concatenate(rows)],
        centroid=np.array([p.mean(axis=0) for p in xyz]),
        box=np.array(boxes),
        truncated=np.zeros(len(rows), np.bool_),
        occluded=np.zeros(len(rows), np.bool_),
    )


def scene(i, *people, together=False):
    """A frame of people, by default one who walks, and of a wall; perhaps all of it as one."""
    people = people or (walker(i),)
    found = frame_of([*people, WALL], i, EYE, points=[*[PERSON_POINTS] * len(people), WALL_POINTS])
    return merged(*found, [range(len(people) + 1)]) if together else found


def held(tracker, n):
    """Ids of who has most of the points of each of n people and of the wall, and what part of them."""
    tracks, proposals = tracker.tracks, tracker.proposals
    members = PERSON_POINTS * n + WALL_POINTS
    assert sorted(proposals.members) == list(range(members))
    owner = tracks.id[tracks.row_of_proposal(len(proposals))][proposals.label(members)]
    ids, shares = [], []
    for own in np.split(owner, PERSON_POINTS * np.arange(1, n + 1)):
        found, count = np.unique(own, return_counts=True)
        ids.append(int(found[count.argmax()]))
        shares.append(count.max() / len(own))
    return ids, shares


def walk(frames, overlapping_pairs, association="kdop", pose=still):
    """A tracker, and (ids of walker and wall, proposals) of every frame, in some of which they touch."""
    tracker, seen = Follower(TrackingConfig(association=association), EFFICIENT), []
    for i in range(frames):
        T = pose(i)
        bodies = transform_boxes(pose(0), np.array([walker(i), WALL]))
        found = frame_of(transform_boxes(inverse(T), bodies), i, T, points=[PERSON_POINTS, WALL_POINTS])
        tracker.follow(*(merged(*found, [(0, 1)]) if i in overlapping_pairs else found))
        seen.append((*held(tracker, 1)[0], len(tracker.proposals)))
    return tracker, seen


@pytest.mark.parametrize("pose", [still, driving])
def test_who_touches_a_wall_for_a_moment_is_told_from_it(pose):
    _, seen = walk(MEET + 8, {MEET, MEET + 1, MEET + 4}, pose=pose)
    assert set(seen) == {(*seen[0][:2], 2)}
    assert seen[0][0] != seen[0][1]


def test_the_paper_takes_proposals_as_they_are():
    _, seen = walk(MEET + 2, {MEET}, association="paper")
    assert seen[MEET][2] == 1


def test_neither_what_is_taken_nor_what_is_left_measures_anything():
    (together, _), (apart, _) = walk(MEET + 1, {MEET}), walk(MEET + 1, ())
    assert (together.tracks.P[:, 0, 0] > 1.5 * apart.tracks.P[:, 0, 0]).all()
    assert together.tracks.splits.tolist() == [1, 0]


def test_nobody_lives_on_what_is_taken():
    overlapping_pairs = range(MEET, MEET + AT_MOST + 2)
    tracker, seen = walk(overlapping_pairs.stop + 2, overlapping_pairs)
    assert [n for *_, n in seen[MEET:]] == [2] * AT_MOST + [1] * 2 + [2] * 2
    assert tracker.tracks.splits.tolist() == [0, 0]


@pytest.mark.parametrize(
    ("change", "points", "wall", "why"),
    [
        ({}, 12, WALL, "too few are where it is expected"),
        ({"height": 0.9}, PERSON_POINTS, [*WALL[:2], -1.2, *WALL[3:5], 0.9, 0.0], "what is there is lower"),
        ({"y": -4.0}, PERSON_POINTS, WALL, "what is there is somewhere else"),
        ({}, PERSON_POINTS, walker(MEET, y=2.6), "what is there is no larger"),
    ],
)
def test_what_is_not_there_is_not_taken(change, points, wall, why):
    tracker = Follower(TrackingConfig(), EFFICIENT)
    for i in range(MEET):
        tracker.follow(*scene(i))
    frame = frame_of([walker(MEET, **change), wall], MEET, EYE, points=[points, 40])
    tracker.follow(*merged(*frame, [(0, 1)]))
    assert len(tracker.proposals) == 1, why


@pytest.mark.parametrize(
    ("kind", "frames", "parts"),
    [
        (ObjectClass.PEDESTRIAN, 8, 2),
        (ObjectClass.PEDESTRIAN, 3, 1),  # followed for too short a time
        (ObjectClass.BACKGROUND, 8, 1),  # a post
    ],
)
def test_who_stands_takes_only_what_a_known_object_does(kind, frames, parts):
    tracker = Follower(TrackingConfig(), EFFICIENT)
    for i in range(frames + 1):
        tracker.tracks.posterior[:] = np.eye(N_CLASSES)[[kind, ObjectClass.BACKGROUND]] if i else 0
        tracker.follow(*scene(i, walker(0), together=i == frames))
    assert len(tracker.proposals) == parts


def test_a_car_is_sought_in_what_is_longer_than_was_seen_of_it():
    """Two of which half is seen are no longer than one may be."""
    tracker, halves, ids = Follower(TrackingConfig(), EFFICIENT), [box(10, 3, 2.0, 1.6), box(12.4, 3, 2.0, 1.6)], []
    for i in range(8):
        tracker.tracks.posterior[:] = np.eye(N_CLASSES)[ObjectClass.CAR]
        found = frame_of([*halves, [*WALL[:1], 9, *WALL[2:]]], i, EYE, points=[*[PERSON_POINTS] * 2, WALL_POINTS])
        tracker.follow(*(merged(*found, [(0, 1), (2,)]) if i == 7 else found))
        found, shares = held(tracker, 2)
        ids.append(found)
        assert min(shares) > 0.95
    assert len(set(ids[0])) == 3
    assert all(found == ids[0] for found in ids)


def test_what_was_away_takes_nothing():
    tracker = Follower(TrackingConfig(), EFFICIENT)
    for i in range(MEET):
        tracker.follow(*scene(i))
    tracker.follow(*frame_of([WALL], MEET, EYE, points=WALL_POINTS))
    tracker.follow(*scene(MEET + 1, together=True))
    assert len(tracker.proposals) == 1


def test_who_is_gone_takes_nothing_of_whom_he_walked_beside():
    """The other is seen where he is himself expected in part, and as large as before."""
    tracker = Follower(TrackingConfig(), EFFICIENT)
    for i in range(MEET):
        tracker.follow(*scene(i, walker(i, 2.15), walker(i)))
    tracker.follow(*scene(MEET, walker(MEET, 2.15)))
    assert len(tracker.proposals) == 2
    assert sorted(tracker.proposals.count) == [PERSON_POINTS, WALL_POINTS]


def test_what_hangs_above_is_left():
    tracker, roof = Follower(TrackingConfig(), EFFICIENT), box(10, 2.5, l=8.0, w=3.0, h=0.5, z=1.2)
    for i in range(MEET + 1):
        found = frame_of([walker(i), roof], i, EYE, points=[PERSON_POINTS, WALL_POINTS])
        tracker.follow(*(merged(*found, [(0, 1)]) if i == MEET else found))
    ids, shares = held(tracker, 1)
    assert len(set(ids)) == 2
    assert shares == [1.0, 1.0]
    np.testing.assert_allclose(tracker.tracks.top, [0.0, 1.45], atol=1e-6)


@pytest.mark.parametrize(
    ("change", "walks"),
    [
        ({}, True),
        ({"envelope": np.full(8, 0.8)}, False),  # as long as a bicycle
        ({"top": 0.4}, False),  # a kerb
        ({"rest_position": [4.0, 0.0]}, False),  # back home
        ({"P": np.eye(4)}, False),  # may stand
    ],
)
def test_walking_is_told_by_shape_and_way(change, walks):
    tracks = TrackTable.blank(1)
    tracks.x[:], tracks.P[:], tracks.envelope[:], tracks.top[:] = [5, 0, 0, 1.3], 0.1 * np.eye(4), 0.3, 1.7
    for column, value in change.items():
        getattr(tracks, column)[:] = value
    assert _walks(tracks, np.array([0])).tolist() == [walks]


@pytest.mark.parametrize("apart_m", [0.62, 0.8])
def test_two_who_walk_side_by_side_into_a_wall_share_no_point(apart_m):
    tracker, ids = Follower(TrackingConfig(), EFFICIENT), []
    for i in range(MEET + 4):
        tracker.follow(*scene(i, walker(i, 2.5 - apart_m), walker(i), together=i in {MEET, MEET + 1}))
        found, shares = held(tracker, 2)
        ids.append(found)
        assert min(shares[:2]) > 0.95
    assert all(found == ids[0] for found in ids)


def test_two_who_meet_are_told_apart_by_where_each_is_expected():
    tracker, ids = Follower(TrackingConfig(), EFFICIENT), []
    for i in range(MEET + 8):
        tracker.tracks.posterior[:] = np.eye(N_CLASSES)[ObjectClass.PEDESTRIAN]
        bodies = [walker(i, y=2.0), box(12.2 - STEP_M * i, 2.65, 0.6, 0.6, 1.7, z=-0.85), [*WALL[:1], 9, *WALL[2:]]]
        found = frame_of(bodies, i, EYE, points=[PERSON_POINTS, PERSON_POINTS, WALL_POINTS])
        tracker.follow(*(merged(*found, [(0, 1), (2,)]) if i in {MEET, MEET + 1} else found))
        found, shares = held(tracker, 2)
        ids.append(found)
        assert min(shares) > 0.95
    assert all(found == ids[0] for found in ids)


def test_who_is_taken_was_seen_when_the_head_looked_there_not_at_the_middle_of_the_wall():
    """The wall, 40 m long, is seen over a third of a sweep, in which the sensor goes 0.7 m."""
    tracker, wall = Follower(TrackingConfig(), EFFICIENT), box(30, 6, l=40.0, w=0.3, h=2.5, z=-0.5)
    for i in range(11):
        frame, proposals = skewed(np.array([walker(86, y=5.4), wall]), i, 0.1, 20.0, 0.0, True)
        tracker.tracks.posterior[:] = np.eye(N_CLASSES)[[ObjectClass.PEDESTRIAN, ObjectClass.BACKGROUND]] if i else 0
        tracker.follow(*(merged(frame, proposals, [(0, 1)]) if i == 10 else (frame, proposals)))
    members = tracker.proposals.members[tracker.proposals.offsets[1] :]
    assert len(tracker.proposals) == 2
    assert np.count_nonzero(members < PERSON_POINTS) > 0.95 * PERSON_POINTS
    np.testing.assert_allclose(tracker.tracks.box[0, :2], walker(86, y=5.4)[:2], atol=0.1)


@given(st.lists(st.integers(2, 9), min_size=1, max_size=5), st.data())
def test_every_point_stays_in_one_proposal(counts, data):
    frame, proposals = frame_of([box(5 * k, 0) for k in range(len(counts))], points=[10 + n for n in counts])
    told, cut = np.arange(5.0 * len(counts)).reshape(-1, 5), np.arange(len(counts)) % 2 == 0
    proposals = dataclasses.replace(proposals, reflectance=told, truncated=cut)
    hosts = data.draw(st.lists(st.sampled_from(range(len(counts))), min_size=1, max_size=4))
    pieces, left = [], {k: list(range(*proposals.offsets[k : k + 2])) for k in range(len(counts))}
    for host in hosts:
        n = data.draw(st.integers(1, 2))
        pieces.append(np.array([left[host].pop() for _ in range(n)]))
    after = carved(proposals, np.array(hosts), pieces, np.full(len(hosts), 0.3))
    assert sorted(after.members) == sorted(proposals.members)
    assert len(after) == len(proposals) + len(hosts)
    assert (after.count > 0).all()
    np.testing.assert_array_equal(after.coordinates.T, frame.points[after.members, :3])
    label, before = after.label(len(frame.points)), proposals.label(len(frame.points))
    for k, (host, piece) in enumerate(zip(hosts, pieces, strict=True)):
        assert set(np.flatnonzero(label == len(proposals) + k)) == set(proposals.members[piece])
        assert (before[proposals.members[piece]] == host).all()
    assert NONE not in label
    for k in {*hosts, *range(len(proposals), len(after))}:
        own = frame.points[label == k, :3]
        np.testing.assert_allclose(after.centroid[k], own.mean(axis=0), atol=1e-5)
        np.testing.assert_allclose(after.box[k, 5], np.ptp(own[:, 2]), atol=1e-5)
    assert after.occluded.tolist() == [False] * len(proposals) + [True] * len(hosts)
    assert after.truncated.tolist() == [*proposals.truncated, *proposals.truncated[hosts]]
    np.testing.assert_allclose(np.sin(2 * (after.box[len(proposals) :, 6] - 0.3)), 0, atol=1e-9)
    untouched = np.setdiff1d(np.arange(len(proposals)), hosts)
    np.testing.assert_array_equal(after.box[untouched], proposals.box[untouched])
    np.testing.assert_array_equal(after.reflectance[: len(proposals)], proposals.reflectance)
    assert np.isnan(after.reflectance[len(proposals) :]).all()


def test_within_is_within_the_slanting_sides_as_well():
    diamond = np.array([1.0, np.sqrt(0.5)] * 4)[:, None]
    scene = SimpleNamespace(expected=diamond)
    x, y = np.array([0.0, 0.9, 0.9, -0.6, 1.3]), np.array([0.0, 0.0, 0.9, 0.6, 0.0])
    assert _Scene._within(scene, x, y, 0).tolist() == [True, True, False, True, False]
