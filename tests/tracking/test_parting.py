"""Somebody touches a wall, and is taken out of it again."""

import dataclasses

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from modt.config import TrackingConfig
from modt.tracking.carving import carved
from modt.tracking.parting import IN_A_ROW
from modt.tracking.states import EFFICIENT
from modt.tracking.tracker import Tracker
from modt.types import N_CLASSES, NONE, ObjectClass

from .tracking_scenes import box, frame_of

EYE = np.eye(4)
WALL = box(12, 3, l=16.0, w=0.3, h=2.5, z=-0.5)
PERSON_POINTS = 80
STEP_M = 0.14
MEET = 14
"""Frame by which somebody has walked so far that nobody takes them for a post."""


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


def scene(i, *others, walls=1, points=PERSON_POINTS):
    return frame_of(
        [walker(i), *others, *[WALL] * walls], i, EYE, points=[points] * (1 + len(others)) + [400] * walls
    )


def walk(frames, touching, groups=((0, 1),), association="robust", **options):
    """A tracker, and (id of the walker, id of the wall, proposals) of every frame, in some of which they touch."""
    tracker, seen = Tracker(TrackingConfig(association=association), EFFICIENT), []
    for i in range(frames):
        frame, proposals = scene(i)
        if i in touching:
            frame, proposals = merged(frame, proposals, [(0, 1)])
        own, tracks = tracker.follow(frame, proposals)
        label, ids = own.label(len(frame.points)), tracks.id[tracks.row_of_proposal(len(own))]
        assert sorted(own.members) == list(range(len(frame.points)))
        held = [ids[np.bincount(label[rows]).argmax()] for rows in (slice(PERSON_POINTS), slice(PERSON_POINTS, None))]
        seen.append((*held, len(own)))
    return tracker, seen


def test_who_touches_a_wall_for_a_moment_is_told_from_it():
    _, seen = walk(MEET + 8, touching={MEET, MEET + 1, MEET + 4})
    assert set(seen) == {(*seen[0][:2], 2)}
    assert seen[0][0] != seen[0][1]


def test_the_paper_takes_proposals_as_they_are():
    _, seen = walk(MEET + 2, touching={MEET}, association="paper")
    assert seen[MEET][2] == 1


def test_what_is_taken_measures_nothing():
    (together, seen), (apart, _) = walk(MEET + 1, touching={MEET}), walk(MEET + 1, touching=())
    row = np.flatnonzero(together.tracks.id == seen[-1][0])[0]
    assert together.tracks.P[row, 0, 0] > 1.5 * apart.tracks.P[row, 0, 0]
    assert together.tracks.takes.tolist() == [1, 0]


def test_nobody_lives_on_what_is_taken():
    touching = range(MEET, MEET + IN_A_ROW + 4)
    _, seen = walk(touching.stop, touching)
    assert [n for *_, n in seen[MEET:]] == [2] * IN_A_ROW + [1] * 4


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
    tracker = Tracker(TrackingConfig(), EFFICIENT)
    for i in range(MEET):
        tracker.follow(*scene(i))
    frame = frame_of([walker(MEET, **change), wall], MEET, EYE, points=[points, 40])
    found, _ = tracker.follow(*merged(*frame, [(0, 1)]))
    assert len(found) == 1, why


def test_what_stands_and_is_no_object_takes_nothing():
    tracker = Tracker(TrackingConfig(), EFFICIENT)
    post = box(8, 2.5, 0.6, 0.6, 1.7, z=-0.85)
    for i in range(8):
        frame, proposals = frame_of([post, WALL], i, EYE, points=[PERSON_POINTS, 400])
        tracker.tracks.posterior[:] = np.eye(N_CLASSES)[ObjectClass.BACKGROUND]
        found, _ = tracker.follow(frame, proposals) if i < 7 else tracker.follow(*merged(frame, proposals, [(0, 1)]))
    assert len(found) == 1


def test_two_who_meet_are_told_apart_by_where_each_is_expected():
    tracker, ids = Tracker(TrackingConfig(), EFFICIENT), []
    for i in range(MEET + 8):
        boxes = [walker(i, y=2.0), box(12.2 - STEP_M * i, 2.65, 0.6, 0.6, 1.7, z=-0.85)]
        frame, proposals = frame_of(boxes, i, EYE, points=PERSON_POINTS)
        if i in {MEET, MEET + 1}:
            frame, proposals = merged(frame, proposals, [(0, 1)])
        found, tracks = tracker.follow(frame, proposals)
        label, owner = found.label(len(frame.points)), tracks.id[tracks.row_of_proposal(len(found))]
        ids.append([owner[np.bincount(label[rows]).argmax()] for rows in (slice(80), slice(80, None))])
    assert all(pair == ids[0] for pair in ids)


@given(st.lists(st.integers(2, 9), min_size=1, max_size=5), st.data())
def test_every_point_stays_in_one_proposal(counts, data):
    frame, proposals = frame_of([box(5 * k, 0) for k in range(len(counts))], points=[6 + n for n in counts])
    proposals = dataclasses.replace(proposals, reflectance=np.arange(5.0 * len(counts)).reshape(-1, 5))
    hosts = data.draw(st.lists(st.sampled_from(range(len(counts))), min_size=1, max_size=4))
    pieces, left = [], {k: list(range(*proposals.offsets[k : k + 2])) for k in range(len(counts))}
    for host in hosts:
        n = data.draw(st.integers(1, 2))
        pieces.append(np.array([left[host].pop() for _ in range(n)]))
    after = carved(proposals, np.array(hosts), pieces, np.zeros(len(hosts)))
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
    untouched = np.setdiff1d(np.arange(len(proposals)), hosts)
    np.testing.assert_array_equal(after.box[untouched], proposals.box[untouched])
    np.testing.assert_array_equal(after.reflectance[: len(proposals)], proposals.reflectance)
    assert np.isnan(after.reflectance[len(proposals) :]).all()
