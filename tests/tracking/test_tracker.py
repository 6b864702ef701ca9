"""The tracker: births, prediction, updates, rest and deaths, and time without sweeps."""

import dataclasses

import numpy as np
import pytest

from modt.config import TrackingConfig
from modt.geometry import wrap
from modt.geometry.kdop import DIRECTIONS
from modt.tracking.states import ACCURATE
from tests.tracking.tracking_scenes import EYE, Follower, box, frame_of


@pytest.mark.parametrize("course", np.deg2rad([0, 90, 180, -45]))
def test_a_moving_box_keeps_its_track_with_its_heading_and_speed(course):
    tracker = Follower()
    speed = 8.0
    dx, dy = speed * 0.1 * np.array([np.cos(course), np.sin(course)])
    tracker.run([[box(12 + i * dx, 6 + i * dy, yaw=course)] for i in range(12)])
    assert tracker.tracks.id.tolist() == [0]
    assert abs(tracker.tracks.x[0, 3] - speed) < 0.8
    assert abs(wrap(tracker.tracks.x[0, 2] - course)) < 0.1


def test_what_is_published_is_a_copy_that_nobody_writes_to():
    follower = Follower()
    follower.follow(*frame_of([box(10, 0)], 0, EYE))
    tracks = follower.confirm([0], [True])
    follower.run([[box(10, 0)]] * 2)
    assert tracks.age.tolist() == [1]
    for column in tracks.columns().values():
        with pytest.raises(ValueError, match="read-only"):
            column[:] = 0


def test_a_track_at_rest_is_stationary_until_it_leaves_its_rest_position():
    tracker = Follower()
    tracker.run([[box(10, 2, 0.6, 0.6)]] * 8)
    assert tracker.tracks.stationary[0]
    assert tracker.tracks.x[0, 3] < 0.3
    tracker.run([[box(10 + 0.4 * i, 2, 0.6, 0.6)] for i in range(1, 13)])
    assert tracker.tracks.id.tolist() == [0]
    assert not tracker.tracks.stationary[0]
    assert tracker.tracks.x[0, 3] == pytest.approx(4.0, abs=0.5)


def test_the_mean_kdop_follows_views_that_jitter_and_restarts_at_an_end_that_jumps():
    tracker = Follower()
    tracker.run([[box(12, 3, 2.0, 1.0)]] * 12, points=2000)
    np.testing.assert_allclose(tracker.tracks.mean_kdop[0][[0, 2, 4, 6]], [1.0, 0.5, 1.0, 0.5], atol=0.05)
    tracker.run([[box(12.5, 3, 3.0, 1.0)]], points=2000)  # its front comes into view
    tracks = tracker.tracks
    reach = tracks.kdop[0] - tracks.x[0, :2] @ DIRECTIONS
    assert tracks.mean_kdop[0, 0] == pytest.approx(reach[0], abs=0.15)
    np.testing.assert_allclose(tracks.mean_kdop[0][[2, 4, 6]], [0.5, 1.0, 0.5], atol=0.15)


N = TrackingConfig().max_missed
STREET = [box(10 + 4 * k, side, 2.0, 1.0) for k in range(6) for side in (-8, 8)]


def at(stamp_s, boxes, pose=EYE):
    frame, proposals = frame_of(boxes, 0, pose)
    return dataclasses.replace(frame, stamp_s=stamp_s), proposals


def settled(pose=EYE, **parts):
    """A follower of a street of classified background, at 0 to 0.5 s."""
    follower = Follower(**parts)
    follower.run([STREET] * 6, T=pose)
    assert follower.tracks.final.all()
    return follower


@pytest.mark.parametrize("gap_s", [1.0, 3600.0])
@pytest.mark.parametrize("pose", [EYE, None], ids=["posed", "unposed"])
@pytest.mark.parametrize("parts", [{}, {"machine": ACCURATE}, {"config": TrackingConfig(association="paper")}])
def test_no_track_outlives_a_long_gap(gap_s, pose, parts):
    assert len(settled(pose, **parts).follow(*at(0.5 + gap_s, [], pose))) == 0
    follower = settled(pose, **parts)
    tracks = follower.follow(*at(0.5 + gap_s, STREET, pose))
    assert tracks.id.min() >= len(STREET)
    assert not tracks.final.any()
    assert (tracks.age == 1).all()
    assert follower.wants_class.all()
    assert np.isfinite(tracks.x).all()
    for k in range(1, 5):  # and what follows is followed
        tracks = follower.follow(*at(0.5 + gap_s + 0.1 * k, STREET, pose))
    assert tracks.hits.tolist() == [5] * len(STREET)


@pytest.mark.parametrize("pose", [EYE, None], ids=["posed", "unposed"])
@pytest.mark.parametrize("steps", [2, N + 1])
def test_tracks_go_on_over_missing_sweeps_and_over_as_long_a_gap_as_they_coast(steps, pose):
    follower = settled(pose)
    for k in range(1, 4):
        tracks = follower.follow(*at(0.5 + 0.1 * k * steps, STREET, pose))
        assert tracks.id.tolist() == list(range(len(STREET)))
        assert tracks.final.all()


def test_a_track_whose_time_ran_out_in_a_short_gap_leaves_its_place():
    follower = settled()
    for k in range(6, 10):
        follower.follow(*at(0.1 * k, STREET[1:]))
    tracks = follower.follow(*at(1.7, STREET))  # unseen for 1.2 s, the others for 0.8
    assert tracks.id.tolist() == [*range(1, len(STREET)), len(STREET)]


@pytest.mark.parametrize(("period_s", "profile_s"), [(0.1, 0.1), (0.05, 0.1), (0.04, 0.1), (0.2, 0.1), (0.05, 0.05)])
def test_a_track_coasts_for_the_time_of_its_frames_at_any_rate(period_s, profile_s):
    follower = Follower(period_s=profile_s)
    for k in range(3):
        follower.follow(*at(period_s * k, [box(10, 0)]))
    coasted = 0
    while len(follower.follow(*at(period_s * (3 + coasted), []))):
        coasted += 1
    assert coasted * period_s == pytest.approx(N * profile_s, abs=profile_s / 2 + 1e-9)


@pytest.mark.parametrize("step_s", [0.0, -0.1])
def test_a_clock_that_stands_or_goes_back_keeps_no_track_alive(step_s):
    follower = settled()
    for k in range(N):
        assert len(follower.follow(*at(0.5 + step_s * (k + 1), []))) == len(STREET)
    assert len(follower.follow(*at(0.5 + step_s * (N + 1), []))) == 0


def test_a_clock_set_back_by_an_hour_goes_on_with_its_tracks():
    follower = settled()
    follower.follow(*at(-3600.0, STREET))
    tracks = follower.follow(*at(-3599.9, STREET))
    assert tracks.id.tolist() == list(range(len(STREET)))
    assert tracks.hits.tolist() == [8] * len(STREET)
