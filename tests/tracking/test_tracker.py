"""The tracker: births, prediction, updates, rest and deaths."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from modt.classes import ObjectClass
from modt.config import TrackingConfig
from modt.geometry.kdop import DIRECTIONS
from modt.tracking.states import ACCURATE, CONVENTIONAL, EFFICIENT
from modt.types import NONE, Cut
from tests.tracking.tracking_scenes import EYE, Follower, box, frame_of

ASSOCIATIONS = ["kdop", "paper"]


@pytest.fixture(params=ASSOCIATIONS)
def tracker(request):
    return Follower(TrackingConfig(association=request.param))


def run(tracker, frames):
    for frame, proposals in frames:
        tracks = tracker.follow(frame, proposals)
        rows = np.flatnonzero(tracker.wants_class)
        tracker.conclude(rows, np.ones(len(rows), np.bool_))
    return tracks


def test_a_stationary_box_keeps_its_track(tracker):
    tracks = run(tracker, [frame_of([box(10, 2)], i, EYE, seed=0) for i in range(10)])
    assert len(tracks) == 1
    assert (tracks.id[0], tracks.age[0], tracks.hits[0]) == (0, 10, 10)
    assert tracks.x[0, 3] < 1.0


@pytest.mark.parametrize("course", np.deg2rad([0, 90, 180, -45]))
def test_a_moving_box_keeps_its_track_with_its_heading_and_speed(course):
    tracker = Follower()
    v = 8.0
    step = v * 0.1 * np.array([np.cos(course), np.sin(course)])
    tracks = run(tracker, [frame_of([box(12 + i * step[0], 6 + i * step[1], yaw=course)], i, EYE) for i in range(12)])
    assert list(tracks.id) == [0]
    assert abs(tracks.x[0, 3] - v) < 0.8
    assert abs(np.angle(np.exp(1j * (tracks.x[0, 2] - course)))) < 0.1


def test_conclude_returns_a_copy(tracker):
    tracker.follow(*frame_of([box(10, 0)], 0, EYE))
    tracks = tracker.conclude([0], [True])
    tracks.id[:] = 99
    assert tracker.tracks.id.tolist() == [0]


@settings(max_examples=40)
@given(
    st.lists(
        st.lists(
            st.tuples(st.floats(-20, 20), st.floats(-20, 20), st.floats(0.3, 6), st.floats(0.3, 3), st.floats(-3, 3)),
            max_size=6,
        ),
        min_size=1,
        max_size=8,
    ),
    st.sampled_from(ASSOCIATIONS),
    st.sampled_from([EFFICIENT, CONVENTIONAL, ACCURATE]),
    st.booleans(),
)
def test_every_proposal_belongs_to_exactly_one_track(scene, association, machine, posed):
    tracker = Follower(TrackingConfig(association=association, max_missed=2), machine)
    known = set()
    for i, boxes in enumerate(scene):
        frame, proposals = frame_of(
            [box(x, y, max(a, b), min(a, b), yaw=c) for x, y, a, b, c in boxes], i, EYE if posed else None
        )
        tracks = tracker.follow(frame, proposals)
        owned = np.sort(tracks.proposal[tracks.proposal != NONE])
        np.testing.assert_array_equal(owned, np.arange(len(proposals)))
        assert len(set(tracks.id)) == len(tracks)
        born = set(tracks.id[tracks.age == 1].tolist())
        assert not born & known  # an id is never used twice
        known |= born
        assert known.issuperset(tracks.id.tolist())
        assert (tracks.missed <= 2).all()
        assert ((tracks.missed > 0) == (tracks.proposal == NONE)).all()
        wants_class = machine.wants_class[tracks.state] & (tracks.missed == 0)
        np.testing.assert_array_equal(tracker.wants_class, wants_class)
        assert np.isfinite(tracks.x).all()
        assert np.isfinite(tracks.P).all()
        assert tracker.tracks is tracks
        rows = np.flatnonzero(tracker.wants_class)
        certain = np.arange(len(rows)) % 2 == 0 if machine is ACCURATE else np.ones(len(rows), np.bool_)
        tracker.conclude(rows, certain)
        np.testing.assert_array_equal(tracks.final, machine.final[tracks.state])


def test_a_track_at_rest_is_stationary_until_it_leaves_its_rest_position():
    tracker = Follower()
    for i in range(20):
        x = 10.0 + 0.4 * max(i - 7, 0)
        tracks = run(tracker, [frame_of([box(x, 2, 0.6, 0.6)], i, EYE, seed=i)])
        assert tracks.id.tolist() == [0]
        if i == 7:
            assert tracks.stationary[0]
            assert tracks.x[0, 3] < 0.3
    assert not tracks.stationary[0]
    assert tracks.x[0, 3] == pytest.approx(4.0, abs=0.5)


def test_the_mean_kdop_follows_views_that_jitter_and_restarts_at_an_end_that_jumps():
    tracker = Follower()
    for i in range(12):
        tracks = run(tracker, [frame_of([box(12, 3, 2.0, 1.0)], i, EYE, points=2000)])
    np.testing.assert_allclose(tracks.mean_kdop[0][[0, 2, 4, 6]], [1.0, 0.5, 1.0, 0.5], atol=0.05)
    tracks = run(tracker, [frame_of([box(12.5, 3, 3.0, 1.0)], 12, EYE, points=2000)])  # its front comes into view
    reach = tracks.kdop[0] - tracks.x[0, :2] @ DIRECTIONS
    assert tracks.mean_kdop[0, 0] == pytest.approx(reach[0], abs=0.15)
    np.testing.assert_allclose(tracks.mean_kdop[0][[2, 4, 6]], [0.5, 1.0, 0.5], atol=0.15)


@pytest.mark.parametrize(
    ("object_class", "cut", "height_m"),
    [
        (ObjectClass.PEDESTRIAN, Cut.TOP, 1.6),
        (ObjectClass.PEDESTRIAN, Cut.BOTTOM, 0.6),  # what is seen whole above is no higher than that
        (ObjectClass.CAR, Cut.TOP, 0.6),
    ],
)
def test_a_person_of_whom_only_legs_are_left_is_as_high_as_before(object_class, cut, height_m):
    tracker = Follower()
    for i in range(6):
        tracker.follow(*frame_of([box(2 - 0.1 * i, 0, 0.5, 0.4, 1.6, z=0.6)], i, EYE))
        tracker.classify(object_class)
    for i in (6, 7):
        frame, proposals = frame_of([box(1.4, 0, 0.5, 0.4, 0.6, z=0.1)], i, EYE)
        tracks = tracker.follow(frame, replace(proposals, cut=np.array([cut])))
        assert len(tracks) == 1
        for of in (tracks.box[0], tracker.proposals.box[0]):
            assert (of[5], of[2] - of[5] / 2) == (pytest.approx(height_m), pytest.approx(-0.2))
