"""Linear Kalman filter with a constant-velocity model, for all tracks at once.

State x = [x, y, vx, vy] in m and m/s. Noise is isotropic: the axes are uncorrelated and share one 2 x 2 covariance,
held as P = [var(position), cov(position, velocity), var(velocity)].
"""

from __future__ import annotations

import numpy as np

from modt.types import Float64


def predict(x: Float64, P: Float64, acceleration_sigma_mps2: float, dt_s: float) -> tuple[Float64, Float64]:
    """States (M, 4) and covariances (M, 3) after dt_s, with white acceleration constant within dt_s."""
    predicted = x.copy()
    predicted[:, :2] += dt_s * x[:, 2:]
    pp, pv, vv = P.T
    q = (acceleration_sigma_mps2 * dt_s) ** 2
    covariance = [pp + 2 * dt_s * pv + dt_s**2 * vv + dt_s**2 / 4 * q, pv + dt_s * vv + dt_s / 2 * q, vv + q]
    return predicted, np.stack(covariance, axis=1)


def update(x: Float64, P: Float64, z: Float64, variance: Float64) -> tuple[Float64, Float64]:
    """States and covariances after measured positions z (M, 2) of variance (M,) [m2] along each axis."""
    gain = P[:, :2] / (P[:, 0] + variance)[:, None]  # of position and velocity
    nu = z - x[:, :2]
    updated = x + np.concatenate([gain[:, :1] * nu, gain[:, 1:] * nu], axis=1)
    return updated, P - np.stack([gain[:, 0] * P[:, 0], gain[:, 0] * P[:, 1], gain[:, 1] * P[:, 1]], axis=1)
