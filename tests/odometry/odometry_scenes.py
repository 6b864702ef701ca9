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


def static_tracks(kdop, ids=None, **flags):
    """Tracks with k-DOPs (M, 8), by default all observed, at rest and candidates."""
    n = len(kdop)
    columns = {name: np.array(flags.get(name, [True] * n)) for name in ("observed", "stationary", "candidate")}
    ids = np.arange(n) if ids is None else np.array(ids)
    return StaticTracks(id=ids, kdop=kdop, predicted_kdop=kdop.T.copy(), **columns)
