"""The zero-velocity update, and none."""

import numpy as np

from modt.tracking.kalman import SPEED, standstill_of
from tests.tracking.tracking_scenes import box, tracks_at


def moving():
    tracks = tracks_at([box(10, 0), box(20, 0)])
    tracks.x[:, SPEED] = 3.0
    return tracks


def test_the_speed_of_a_track_at_rest_is_observed_as_zero():
    tracks = moving()
    standstill_of(0.5).observe(tracks, np.array([1]))
    assert tracks.x[0, SPEED] == 3.0
    assert 0.0 < tracks.x[1, SPEED] < 3.0


def test_or_nothing_is_observed():
    tracks = moving()
    standstill_of(None).observe(tracks, np.array([0, 1]))
    np.testing.assert_array_equal(tracks.x, moving().x)
