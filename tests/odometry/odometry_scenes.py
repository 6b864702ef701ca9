"""Scenes of stationary boxes past which a sensor drives, for the tests of the odometry."""

import numpy as np

from modt.geometry import rotation_zyx, se3
from modt.observations import StaticTracks


def street(seed=0, n=40):
    """(n, 7) boxes of many sizes on both sides of a road."""
    rng = np.random.default_rng(seed)
    place = rng.uniform([-20, -25], [60, 25], (n, 2))
    size = rng.uniform(0.3, 2.0, (n, 2))
    return np.c_[place, np.full(n, -1.0), size.max(axis=1), size.min(axis=1), np.full(n, 1.5), rng.uniform(-3, 3, n)]


def constant_turn(time_s, speed_mps, yaw_rate_radps):
    """Position (complex) [m] and heading [rad] at one time or many, from rest at the origin."""
    yaw = yaw_rate_radps * np.asarray(time_s)
    return speed_mps * np.asarray(time_s) * np.exp(0.5j * yaw) * np.sinc(yaw / (2 * np.pi)), yaw


def constant_turn_pose(time_s, speed_mps, yaw_rate_radps):
    """(4, 4) pose of the same sensor."""
    c, yaw = constant_turn(time_s, speed_mps, yaw_rate_radps)
    return se3(rotation_zyx(0, 0, yaw), np.array([c.real, c.imag, 0.0]))


def static_tracks(kdop, ids=None, observed=None, stationary=None, candidate=None):
    """Tracks with k-DOPs (M, 8), by default all observed, at rest and candidates."""
    kdop = np.asarray(kdop, np.float64)
    n = len(kdop)

    def flags(given):
        return np.ones(n, np.bool_) if given is None else np.array(given, np.bool_)

    return StaticTracks(
        id=np.arange(n) if ids is None else np.array(ids, np.int64),
        observed=flags(observed),
        stationary=flags(stationary),
        candidate=flags(candidate),
        kdop=kdop,
        predicted_kdop=kdop.T.copy(),
    )
