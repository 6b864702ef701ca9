"""The linear Kalman filter of a place that keeps its velocity, for all tracks at once.

State x = [x, y, vx, vy]: m, m/s. Noise is the same in all directions, so the covariance is the same along both axes,
none lies between them, and three numbers hold it: P = [of the place, of place and velocity, of the velocity].
"""

from __future__ import annotations

import numpy as np

from modt.types import Float64


def predict(x: Float64, P: Float64, acceleration: float, dt_s: float) -> tuple[Float64, Float64]:
    """States (M, 4) and covariances (M, 3) dt_s later, after an unknown acceleration [m/s2], constant within dt_s."""
    moved = x.copy()
    moved[:, :2] += dt_s * x[:, 2:]
    place, both, velocity = P.T
    pushed = (acceleration * dt_s) ** 2
    grown = [
        place + 2 * dt_s * both + dt_s**2 * velocity + dt_s**2 / 4 * pushed,
        both + dt_s * velocity + dt_s / 2 * pushed,
        velocity + pushed,
    ]
    return moved, np.stack(grown, axis=1)


def update(x: Float64, P: Float64, z: Float64, variance: Float64) -> tuple[Float64, Float64]:
    """States and covariances after the observed places z (M, 2) of variance (M,) along each axis [m2]."""
    gain = P[:, :2] / (P[:, 0] + variance)[:, None]  # of the place and of the velocity
    nu = z - x[:, :2]
    after = x + np.concatenate([gain[:, :1] * nu, gain[:, 1:] * nu], axis=1)
    squeezed = P - np.stack([gain[:, 0] * P[:, 0], gain[:, 0] * P[:, 1], gain[:, 1] * P[:, 1]], axis=1)
    return after, squeezed
