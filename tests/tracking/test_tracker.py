"""The tracker: births, prediction, updates, rest and deaths."""

import numpy as np
import pytest

from modt.geometry import wrap
from modt.geometry.kdop import DIRECTIONS
from tests.tracking.tracking_scenes import EYE, Follower, box, frame_of


@pytest.mark.parametrize("course", np.deg2rad([0, 90, 180, -45]))
def test_a_moving_box_keeps_its_track_with_its_heading_and_speed(course):
    tracker, speed = Follower(), 8.0
    dx, dy = speed * 0.1 * np.array([np.cos(course), np.sin(course)])
    tracker.run([[box(12 + i * dx, 6 + i * dy, yaw=course)] for i in range(12)])
    assert tracker.tracks.id.tolist() == [0]
    assert abs(tracker.tracks.x[0, 3] - speed) < 0.8
    assert abs(wrap(tracker.tracks.x[0, 2] - course)) < 0.1


def test_conclude_returns_a_copy():
    tracker = Follower()
    tracker.follow(*frame_of([box(10, 0)], 0, EYE))
    tracks = tracker.conclude([0], [True])
    tracks.id[:] = 99
    assert tracker.tracks.id.tolist() == [0]


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
