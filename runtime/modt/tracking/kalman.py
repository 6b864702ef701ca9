"""The extended Kalman filter of a track (Equation 1), for all tracks at once.

State x = [x, y, heading, speed] in the world: m, m, rad, m/s. Only the place is observed.

M states are a (4, M) array and their covariances a (4, 4, M) one: each number of the state is a contiguous row over
all tracks, and arithmetic runs along it. Along axes of four it would be slow.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from modt.geometry import wrap
from modt.tracking.tuning import FilterTuning
from modt.types import Float64, Int

X, Y, HEADING, SPEED = range(4)


def components_first(x: Float64, P: Float64) -> tuple[Float64, Float64]:
    """(n, M) and (n, n, M), each number a contiguous row over all tracks, of a table's (M, n) and (M, n, n)."""
    return x.T.copy(), P.transpose(1, 2, 0).copy()


def tracks_first(x: Float64, P: Float64) -> tuple[Float64, Float64]:
    """(M, n) and (M, n, n), as a table holds them, of the filter's (n, M) and (n, n, M)."""
    return x.T.copy(), P.transpose(2, 0, 1).copy()


def product(A: Float64, B: Float64) -> Float64:
    """(i, k, M) the matrices A (i, 2, M) times the matrices B (2, k, M)."""
    out: Float64 = A[:, :1] * B[0] + A[:, 1:] * B[1]
    return out


def transposed(A: Float64) -> Float64:
    """(j, i, M) the matrices A (i, j, M), transposed."""
    return A.transpose(1, 0, 2)


def symmetric(P: Float64) -> Float64:
    """(4, 4, M) covariances, symmetric despite rounding."""
    return (P + transposed(P)) / 2


class ProcessNoise(NamedTuple):
    """Variances that a time step adds to the parts of a state."""

    position: float  # along either axis [m2]
    heading: float  # [rad2]
    speed: float  # [m2/s2]

    @classmethod
    def over(cls, dt_s: float, acceleration_mps2: float, turn_radps: float) -> ProcessNoise:
        """The noise of an acceleration and of a rate of turn, given as standard deviations, that last for dt_s."""
        across = dt_s**2 / 2 * acceleration_mps2
        turn = dt_s * turn_radps
        along = dt_s * acceleration_mps2
        return cls(position=across * across, heading=turn * turn, speed=along * along)


def motion_jacobian(x: Float64, dt_s: float) -> Float64:
    """(2, 2, M) derivative of the motion's x and y by heading and speed, at x; heading and speed stay as they are."""
    along_x = dt_s * np.cos(x[HEADING])
    along_y = dt_s * np.sin(x[HEADING])
    return np.array(((-along_y * x[SPEED], along_x), (along_x * x[SPEED], along_y)))


def predict(
    x: Float64, P: Float64, dt_s: float, acceleration_mps2: float, turn_radps: float
) -> tuple[Float64, Float64]:
    """States and covariances dt_s later, F P F' + Q.

    Q is what an acceleration and a rate of turn, white within dt_s, add, given as standard deviations. Across its
    heading a track can be pushed as hard as along it while it stands, since its heading is then unknown.
    """
    F = motion_jacobian(x, dt_s)
    moved = x.copy()
    moved[:2] += F[:, 1] * x[SPEED]  # the motion is linear in the speed
    noise = ProcessNoise.over(dt_s, acceleration_mps2, turn_radps)
    after = P.copy()
    cross = P[:2, 2:] + product(F, P[2:, 2:])  # of position with heading and speed
    after[:2, :2] += product(F, P[2:, :2]) + product(cross, transposed(F))
    cross[:, 1] += noise.speed / 2 * F[:, 1]
    after[:2, 2:] = cross
    after[2:, :2] = transposed(cross)
    after[X, X] += noise.position
    after[Y, Y] += noise.position
    after[HEADING, HEADING] += noise.heading
    after[SPEED, SPEED] += noise.speed
    return moved, after


def update(x: Float64, P: Float64, z: Float64, R: Float64) -> tuple[Float64, Float64]:
    """States and covariances after the observed places z (2, M) of covariance R (2, 2, M)."""
    innovation = z - x[:2]
    S = P[:2, :2] + R
    K = product(P[:, :2], inverse_2x2(S))
    after = x + product(K, innovation[:, None])[:, 0]
    after[HEADING] = wrap(after[HEADING])
    return after, symmetric(P - product(K, P[:2]))


def with_heading(x: Float64, P: Float64, heading_rad: Float64) -> tuple[Float64, Float64]:
    """Turn the heading of tracks that stand to where they seem to go.

    At speed zero all headings are the same state, but the linearisation sees motion along the chosen one alone. So
    the heading is chosen anew, and the covariance along it and across it turns with it.
    """
    turn = heading_rad - x[HEADING]
    c = np.cos(turn)
    s = np.sin(turn)
    rotation = np.array(((c, -s), (s, c)))
    facing = x.copy()
    facing[HEADING] = wrap(heading_rad)
    turned = P.copy()
    turned[:2] = product(rotation, P[:2])
    turned[:, :2] = product(turned[:, :2], transposed(rotation))
    return facing, turned


def with_forward_speed(x: Float64, P: Float64) -> tuple[Float64, Float64]:
    """The same motion with a speed that is not negative."""
    sign = np.where(x[SPEED] < 0, -1.0, 1.0)
    forward = x.copy()
    forward[SPEED] *= sign
    forward[HEADING] = np.where(sign < 0, wrap(x[HEADING] + np.pi), x[HEADING])
    turned = P.copy()
    turned[SPEED] *= sign
    turned[:, SPEED] *= sign
    return forward, turned


def inverse_2x2(S: Float64) -> Float64:
    """(2, 2, M) inverses."""
    (a, b), (c, d) = S
    inverse: Float64 = np.array(((d, -b), (-c, a))) / (a * d - b * c)
    return inverse


def velocity_of(x: Float64, P: Float64) -> tuple[Float64, Float64]:
    """Velocities (M, 2) [m/s] and their covariances (M, 2, 2), given states (M, 4) and covariances of a table."""
    ahead = np.column_stack([np.cos(x[:, HEADING]), np.sin(x[:, HEADING])])
    velocity = x[:, SPEED, None] * ahead
    left = np.column_stack([-velocity[:, 1], velocity[:, 0]])
    J = np.stack([left, ahead], axis=2)  # derivative by heading and speed
    return velocity, J @ P[:, HEADING:, HEADING:] @ J.transpose(0, 2, 1)


class Filter:
    """The filter on a table of states x (M, 4) and covariances P (M, 4, 4), in place: the reference.

    Args:
        tuning: noise of the process.
    """

    def __init__(self, tuning: FilterTuning = FilterTuning()) -> None:
        self.tuning = tuning

    def predict(self, x: Float64, P: Float64, dt_s: float) -> None:
        """All states dt_s later."""
        tuning = self.tuning
        after = predict(*components_first(x, P), dt_s, tuning.acceleration_sigma_mps2, tuning.turn_sigma_radps)
        x[:], P[:] = tracks_first(*after)

    def update(self, x: Float64, P: Float64, rows: Int, z: Float64, R: Float64) -> None:
        """The rows after the observed places z (K, 2) of covariance R (K, 2, 2), at a speed that is not negative.

        One that may stand is turned to where it seems to go.
        """
        state, covariance = components_first(x.take(rows, axis=0), P.take(rows, axis=0))
        position, noise = components_first(z, R)
        turned = with_heading(state, covariance, _heading(state, covariance[SPEED, SPEED], position))
        x[rows], P[rows] = tracks_first(*with_forward_speed(*update(*turned, position, noise)))


def _heading(x: Float64, speed_variance: Float64, z: Float64) -> Float64:
    """(K,) heading towards z (2, K) of states (4, K) whose speed may be 0, of others their own."""
    step_x, step_y = z - x[:2]
    heading: Float64 = np.where(np.abs(x[SPEED]) < np.sqrt(speed_variance), np.arctan2(step_y, step_x), x[HEADING])
    return heading
