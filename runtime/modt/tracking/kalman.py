"""The extended Kalman filter of a track (Equation 1), for all tracks at once.

State x = [x, y, heading, speed] in the world: m, m, rad, m/s. Only the place is observed.
"""

from __future__ import annotations

import numpy as np

from modt.geometry import wrap
from modt.types import Float64

X, Y, HEADING, SPEED = range(4)
UNCHANGED = np.eye(4)[None]
"""(1, 4, 4) the change that is none."""


def motion(x: Float64, dt_s: float) -> Float64:
    """(M, 4) F(x): constant heading and speed for dt_s (Equation 1)."""
    moved = x.copy()
    moved[:, X] += dt_s * np.cos(x[:, HEADING]) * x[:, SPEED]
    moved[:, Y] += dt_s * np.sin(x[:, HEADING]) * x[:, SPEED]
    return moved


def motion_jacobian(x: Float64, dt_s: float) -> Float64:
    """(M, 4, 4) derivative of F at x."""
    F = UNCHANGED.repeat(len(x), axis=0)
    c, s = np.cos(x[:, HEADING]), np.sin(x[:, HEADING])
    F[:, X, HEADING], F[:, X, SPEED] = -dt_s * s * x[:, SPEED], dt_s * c
    F[:, Y, HEADING], F[:, Y, SPEED] = dt_s * c * x[:, SPEED], dt_s * s
    return F


def process_noise(x: Float64, dt_s: float, acceleration: Float64 | float, turn: Float64 | float) -> Float64:
    """(M, 4, 4) what an acceleration [m/s2] and a rate of turn [rad/s], white within dt_s, add to the covariance.

    Across its heading a track can be pushed as hard as along it while it stands: then the heading says nothing.
    """
    c, s = np.cos(x[:, HEADING]), np.sin(x[:, HEADING])
    along, across = np.square(dt_s * acceleration), np.square(dt_s**2 / 2 * acceleration)
    Q = np.zeros((len(x), 4, 4))
    Q[:, X, X] = Q[:, Y, Y] = across  # as hard across as along
    Q[:, X, SPEED] = Q[:, SPEED, X] = dt_s / 2 * along * c
    Q[:, Y, SPEED] = Q[:, SPEED, Y] = dt_s / 2 * along * s
    Q[:, SPEED, SPEED] = along
    Q[:, HEADING, HEADING] = np.square(dt_s * turn)
    return Q


def predict(x: Float64, P: Float64, Q: Float64, dt_s: float) -> tuple[Float64, Float64]:
    """States and covariances dt_s later."""
    F = motion_jacobian(x, dt_s)
    moved = x.copy()
    moved[:, :2] += F[:, :2, SPEED] * x[:, SPEED, None]  # motion(), which is linear in the speed
    changed = congruent(F, P)
    changed += Q
    return moved, changed


def congruent(A: Float64, P: Float64) -> Float64:
    """(M, 4, 4) A P A', the covariances after a linear change A (M, 4, 4) of the states."""
    changed: Float64 = A @ P @ A.transpose(0, 2, 1).copy()  # a transposed view is multiplied at half the speed
    return changed


def innovation(x: Float64, P: Float64, z: Float64, R: Float64) -> tuple[Float64, Float64]:
    """(M, 2) what the observed places z [m] add, and its (M, 2, 2) covariance, R (M, 2, 2) being theirs."""
    return z - x[:, :2], P[:, :2, :2] + R


def update(x: Float64, P: Float64, z: Float64, R: Float64) -> tuple[Float64, Float64]:
    """States and covariances after the observed places z (M, 2) of covariance R (M, 2, 2)."""
    nu, S = innovation(x, P, z, R)
    K = P[:, :, :2] @ inverse_2x2(S)
    after = x + (K @ nu[:, :, None])[:, :, 0]
    after[:, HEADING] = wrap(after[:, HEADING])
    squeezed = P - K @ P[:, :2, :]
    return after, (squeezed + squeezed.transpose(0, 2, 1)) / 2


def observe_speed(x: Float64, P: Float64, speed_mps: float, sigma_mps: float) -> tuple[Float64, Float64]:
    """States and covariances after an observed speed of deviation sigma."""
    K = P[:, :, SPEED] / (P[:, SPEED, SPEED] + sigma_mps**2)[:, None]
    after = x + K * (speed_mps - x[:, SPEED])[:, None]
    after[:, HEADING] = wrap(after[:, HEADING])
    squeezed: Float64 = P - K[:, :, None] * P[:, SPEED][:, None, :]
    return after, (squeezed + squeezed.transpose(0, 2, 1)) / 2


def face(x: Float64, P: Float64, heading_rad: Float64) -> tuple[Float64, Float64]:
    """Turn the heading of tracks that stand to where they seem to go.

    At speed zero every heading says the same, and the filter's linearisation would see motion along one of them
    only: the heading may be chosen, and what is known along it and across it turns with it.
    """
    turn = heading_rad - x[:, HEADING]
    c, s = np.cos(turn), np.sin(turn)
    T = UNCHANGED.repeat(len(x), axis=0)
    T[:, X, X], T[:, X, Y], T[:, Y, X], T[:, Y, Y] = c, -s, s, c
    out = x.copy()
    out[:, HEADING] = wrap(heading_rad)
    return out, congruent(T, P)


def turn_about(x: Float64, P: Float64) -> tuple[Float64, Float64]:
    """The same motion with a speed that is not negative."""
    back = np.flatnonzero(x[:, SPEED] < 0)
    out, cov = x.copy(), P.copy()
    out[back, SPEED] *= -1
    out[back, HEADING] = wrap(x[back, HEADING] + np.pi)
    cov[back, SPEED, :] *= -1
    cov[back, :, SPEED] *= -1
    return out, cov


def inverse_2x2(S: Float64) -> Float64:
    """(M, 2, 2) inverses."""
    a, b, c, d = S[:, 0, 0], S[:, 0, 1], S[:, 1, 0], S[:, 1, 1]
    inverse = np.empty_like(S)
    inverse[:, 0, 0], inverse[:, 0, 1], inverse[:, 1, 0], inverse[:, 1, 1] = d, -b, -c, a
    inverse /= (a * d - b * c)[:, None, None]
    return inverse


def mahalanobis_squared(nu: Float64, S: Float64) -> Float64:
    """(M,) nu' S^-1 nu of residuals (M, 2) and covariances (M, 2, 2)."""
    a, b, d = S[:, 0, 0], S[:, 0, 1], S[:, 1, 1]
    dx, dy = nu[:, 0], nu[:, 1]
    out: Float64 = (d * dx * dx - 2 * b * dx * dy + a * dy * dy) / (a * d - b * b)
    return out
