import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from modt.config import TrackingConfig
from modt.tracking.states import ACCURATE, EFFICIENT
from modt.types import NONE, Proposals
from tests.tracking.tracking_scenes import Follower, box, frame_of

ASSOCIATIONS = ["robust", "paper"]
EYE = np.eye(4)


@pytest.fixture(params=ASSOCIATIONS)
def tracker(request):
    return Follower(TrackingConfig(association=request.param, ask_from=1), EFFICIENT)


def names(tracker):
    return [tracker.machine.names[s] for s in tracker.tracks.state]


def run(tracker, frames, settle=True):
    for frame, proposals in frames:
        tracks = tracker.follow(frame, proposals)
        if settle:
            rows = np.flatnonzero(tracker.wants_class)
            tracker.conclude(rows, np.ones(len(rows), np.bool_))
    return tracks


def test_a_standing_box_keeps_its_track(tracker):
    tracks = run(tracker, [frame_of([box(10, 2)], i, EYE, seed=0) for i in range(10)])
    assert len(tracks) == 1
    assert (tracks.id[0], tracks.age[0], tracks.hits[0]) == (0, 10, 10)
    assert tracks.x[0, 3] < 1.0


@pytest.mark.parametrize("course", np.deg2rad([0, 90, 180, -45]))
def test_a_moving_box_keeps_its_track_and_shows_its_course(course):
    tracker = Follower(TrackingConfig(), EFFICIENT)
    v = 8.0
    step = v * 0.1 * np.array([np.cos(course), np.sin(course)])
    tracks = run(tracker, [frame_of([box(12 + i * step[0], 6 + i * step[1], yaw=course)], i, EYE) for i in range(12)])
    assert list(tracks.id) == [0]
    assert abs(tracks.x[0, 3] - v) < 0.8
    assert abs(np.angle(np.exp(1j * (tracks.x[0, 2] - course)))) < 0.1


def test_states_of_a_life(tracker):
    tracker.follow(*frame_of([box(10, 0)], 0, EYE))
    assert names(tracker) == ["unmatched"]
    assert tracker.wants_class.all()
    tracker.conclude(np.array([0]), np.array([True]))
    assert names(tracker) == ["tracked"]
    tracker.follow(*frame_of([box(10, 0)], 1, EYE))
    assert names(tracker) == ["tracked"]
    assert not tracker.wants_class.any()
    tracker.follow(*frame_of([], 2, EYE))
    assert names(tracker) == ["lost"]
    assert tracker.tracks.proposal[0] == NONE
    tracker.follow(*frame_of([box(10, 0)], 3, EYE))
    assert names(tracker) == ["tracked"]
    assert tracker.tracks.id[0] == 0
    for i in range(4, 5 + tracker.config.max_missed):
        assert len(tracker.tracks) == 1
        tracker.follow(*frame_of([], i, EYE))
    assert len(tracker.tracks) == 0


def test_a_track_that_waits_for_its_class_is_followed_and_dies_like_others(tracker):
    for i in range(3):
        tracker.follow(*frame_of([box(10, 0)], i, EYE))
        assert names(tracker) == ["unmatched"]
        assert tracker.wants_class.all()
    tracker.follow(*frame_of([], 3, EYE))
    assert names(tracker) == ["lost_unmatched"]
    assert not tracker.wants_class.any()
    tracker.follow(*frame_of([box(10, 0)], 4, EYE))
    assert names(tracker) == ["unmatched"]
    assert list(tracker.tracks.id) == [0]
    for i in range(5, 6 + tracker.config.max_missed):
        tracker.follow(*frame_of([], i, EYE))
    assert len(tracker.tracks) == 0


@pytest.mark.parametrize(("seen", "patience"), [(2, 4), (3, 8)])
def test_what_was_never_asked_for_is_given_up_sooner(seen, patience):
    tracker = Follower(TrackingConfig(ask_from=3, max_missed=8), EFFICIENT)
    for i in range(seen):
        tracker.follow(*frame_of([box(10, 0)], i, EYE))
    for i in range(seen, seen + patience):
        tracker.follow(*frame_of([], i, EYE))
        assert len(tracker.tracks) == 1
    tracker.follow(*frame_of([], seen + patience, EYE))
    assert len(tracker.tracks) == 0


def test_doubt_is_asked_again_until_it_is_gone():
    tracker = Follower(TrackingConfig(ask_from=1), ACCURATE)
    tracker.follow(*frame_of([box(10, 0)], 0, EYE))
    tracker.conclude(np.array([0]), np.array([False]))
    assert names(tracker) == ["tracked_unclassified"]
    tracker.follow(*frame_of([box(10, 0)], 1, EYE))
    assert tracker.wants_class.all()
    tracker.conclude(np.array([0]), np.array([False]))
    tracker.follow(*frame_of([], 2, EYE))
    assert names(tracker) == ["lost_unclassified"]
    tracker.follow(*frame_of([box(10, 0)], 3, EYE))
    tracker.conclude(np.array([0]), np.array([True]))
    assert names(tracker) == ["tracked_classified"]
    tracker.follow(*frame_of([], 4, EYE))
    assert names(tracker) == ["lost_classified"]


def test_classifying_what_did_not_ask_changes_no_state(tracker):
    run(tracker, [frame_of([box(10, 0)], i, EYE) for i in range(2)])
    tracker.conclude(np.array([0]), np.array([False]))
    assert names(tracker) == ["tracked"]


@settings(deadline=None, max_examples=40)
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
    st.sampled_from([EFFICIENT, ACCURATE]),
    st.booleans(),
)
def test_every_proposal_belongs_to_exactly_one_track(scene, association, machine, posed):
    tracker = Follower(TrackingConfig(association=association, max_missed=2), machine)
    seen = set()
    for i, boxes in enumerate(scene):
        frame, proposals = frame_of(
            [box(x, y, max(a, b), min(a, b), yaw=c) for x, y, a, b, c in boxes], i, EYE if posed else None
        )
        tracks = tracker.follow(frame, proposals)
        owned = np.sort(tracks.proposal[tracks.proposal != NONE])
        np.testing.assert_array_equal(owned, np.arange(len(proposals)))
        assert len(set(tracks.id)) == len(tracks)
        gone = seen - set(tracks.id)
        seen |= set(tracks.id)
        assert not gone & set(tracks.id)
        assert (tracks.missed <= 2).all()
        assert ((tracks.missed > 0) == (tracks.proposal == NONE)).all()
        assert np.isfinite(tracks.x).all()
        assert np.isfinite(tracks.P).all()
        assert tracker.tracks is tracks
        asking = np.flatnonzero(tracker.wants_class)
        tracker.conclude(asking, np.arange(len(asking)) % 2 == 0)


def test_frames_without_anything(tracker):
    frame, _ = frame_of([], 0)
    assert len(tracker.follow(frame, Proposals.empty())) == 0
    assert len(tracker.wants_class) == 0
    tracker.conclude(np.zeros(0, np.int64), np.zeros(0, np.bool_))


def test_two_runs_are_the_same():
    frames = [
        frame_of([box(10 + 0.5 * i, 0), box(8, 5), box(15, -4, 0.6, 0.6)][: 2 + i % 2], i, EYE) for i in range(9)
    ]
    first, second = (run(Follower(TrackingConfig(), EFFICIENT), frames) for _ in range(2))
    for (name, a), (_, b) in zip(first.columns(), second.columns(), strict=True):
        np.testing.assert_array_equal(a, b, err_msg=name)


def test_background_that_went_away_is_as_agile_as_anything():
    """It was not what it was taken for."""
    grown = []
    for step_m in (0.0, 0.15):
        tracker = Follower(TrackingConfig(), EFFICIENT)
        for i in range(12):
            tracks = tracker.follow(*frame_of([box(12 + step_m * i, 3, 0.6, 0.6, 1.7)], i, EYE))
            tracks.posterior[:], tracks.final[:] = np.eye(4)[0], True
        before = tracks.P[0, 3, 3]
        grown.append(tracker.follow(*frame_of([], 12, EYE)).P[0, 3, 3] - before)
    assert grown[1] == pytest.approx(np.square(0.1 * TrackingConfig().acceleration_sigma_mps2))
    assert grown[0] == pytest.approx(grown[1] / 16)
