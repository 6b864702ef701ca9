"""Where the sensor was, by the tracks: a run records their boxes in both frames, not the pose between them."""

from __future__ import annotations

import numpy as np

from modt.types import Float64

ROUNDS = 3
OUTLIER = 3.0
"""Median distances beyond which a track does not count: filters lag behind boxes that grow."""


def sensor_pose(sensor: Float64, world: Float64, otherwise: Float64) -> Float64:
    """(3,) x, y [m], yaw [rad] of the sensor in the world.

    Args:
        sensor: (n, 2) positions in the sensor's frame [m].
        world: (n, 2) the same in the world [m].
        otherwise: (3,) pose where fewer than two are given.
    """
    if len(sensor) < 2:
        return otherwise
    a, b = (xy[:, 0] + 1j * xy[:, 1] for xy in (sensor, world))
    used = np.ones(len(a), np.bool_)
    for _ in range(ROUNDS):
        a0, b0 = a[used].mean(), b[used].mean()
        turn = np.angle(np.vdot(a[used] - a0, b[used] - b0))
        origin = b0 - np.exp(1j * turn) * a0
        off = np.abs(origin + np.exp(1j * turn) * a - b)
        used = off <= OUTLIER * np.median(off)
    return np.array([origin.real, origin.imag, turn])
