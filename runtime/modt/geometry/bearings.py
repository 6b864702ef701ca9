"""Bearings without trigonometry."""

from __future__ import annotations

import numpy as np

from modt.types import Float32


def pseudo_angle(x: Float32, y: Float32) -> Float32:
    """(N,) direction as a number from 0 to 4, monotonic in the angle from -90 degrees, without an arctangent."""
    turn = np.abs(x)
    turn += np.abs(y)
    np.maximum(turn, np.float32(1e-6), out=turn)
    np.divide(y, turn, out=turn)
    np.subtract(np.float32(2.0), turn, out=turn, where=x < 0)
    turn += np.float32(1.0)
    return turn
