"""Filter of two hypotheses, a track rests or moves at constant velocity: an interacting multiple model.

Each hypothesis has its own estimate of the state. Between two frames a track may start or stop, so each estimate
takes in a share of the other. A position is then filtered by both, and the hypothesis that expected it better becomes
more probable. What is reported is the mean of both by their probabilities: a track that rests reads no velocity.

H. A. P. Blom, Y. Bar-Shalom, The interacting multiple model algorithm for systems with Markovian switching
coefficients, IEEE Transactions on Automatic Control, 1988.
"""

from __future__ import annotations

import ctypes
import math
from typing import NamedTuple

import numpy as np

from modt.class_sizes import IS_PERSON
from modt.geometry.kernels import GeometryKernels
from modt.native.declarations import declare
from modt.tracking.kalman import HEADING, SPEED, X, Y, components_first
from modt.tracking.track_table import TrackTable
from modt.tracking.tuning import MotionFilterTuning
from modt.types import Float64, Int

N = 4
"""Components of the state of a moving track: x, y [m] and their velocities [m/s], world frame."""
IN_PLANE = (X, Y)
VELOCITY = 2
"""Index of the velocity along x; that along y follows."""


class Step(NamedTuple):
    """Effect of a time step, alike for all tracks."""

    dt_s: float
    starts: float  # probability that a track at rest starts
    stops: float  # probability that a moving track stops

    @classmethod
    def over(cls, dt_s: float, tuning: MotionFilterTuning) -> Step:
        """The step of a duration."""
        return cls(dt_s, -math.expm1(-dt_s * tuning.starts_per_s), -math.expm1(-dt_s * tuning.stops_per_s))


class Fit(NamedTuple):
    """How well a hypothesis expected positions."""

    distance: Float64  # (R,) squared distance of the positions from the expected ones, by their covariance
    determinant: Float64  # (R,) determinant of that covariance [m4]


class MotionFilter:
    """Predicts and updates the columns of both hypotheses in place: the reference in NumPy.

    Args:
        tuning: noise of both motions, and rates of starting and stopping.
    """

    def __init__(self, tuning: MotionFilterTuning = MotionFilterTuning()) -> None:
        self.tuning = tuning

    def begin(self, tracks: TrackTable, new: slice, position: Float64) -> None:
        """Write the state of new tracks at their first positions (B, 2)."""
        tuning = self.tuning
        position_variance = tuning.initial_position_sigma_m**2
        speed_variance = tuning.initial_speed_sigma_mps**2
        tracks.moving_mean[new, :VELOCITY] = tracks.resting_mean[new] = tracks.x[new, :VELOCITY] = position
        tracks.moving_covariance[new] = np.diag([position_variance] * 2 + [speed_variance] * 2)
        tracks.resting_covariance[new] = np.diag([position_variance] * 2)
        tracks.moving_probability[new] = tuning.initially_moving
        tracks.velocity_covariance[new] = np.diag([tuning.initially_moving * speed_variance] * 2)
        tracks.P[new] = np.diag([position_variance] * 2 + [np.pi**2, tuning.initially_moving * speed_variance])

    def predict(self, tracks: TrackTable, dt_s: float) -> None:
        """All tracks dt_s later: mixing, then the motion of each hypothesis."""
        step = Step.over(dt_s, self.tuning)
        p = tracks.moving_probability
        # By Bayes' rule: what moves now has just started, and what rests now has just stopped, with these shares.
        moving = p * (1 - step.stops) + (1 - p) * step.starts
        self._predict(tracks, step, (1 - p) * step.starts / moving, p * step.stops / (1 - moving))
        p[:] = moving
        self.combine(tracks)

    def update(self, tracks: TrackTable, rows: Int, position: Float64, noise: Float64) -> Float64:
        """Update both hypotheses of rows (R,) by positions (R, 2) of covariance `noise` (R, 2, 2).

        Returns:
            (R,) logarithm of the likelihood of moving over that of resting, bounded. A position that a moving track
            was not expected at either is no evidence of motion.
        """
        moving, resting = self._update(tracks, rows, position, noise)
        is_person = IS_PERSON[tracks.object_class[rows]]
        # The velocity of a new track is as uncertain as that of a fast car, which speaks against a person's motion.
        least = np.where(is_person, np.exp(-2 * self.tuning.max_person_penalty), 0.0)
        precision = np.maximum(resting.determinant / moving.determinant, least)
        log_ratio = (resting.distance - moving.distance + np.log(precision)) / 2
        most = np.where(moving.distance < self.tuning.max_distance, self.tuning.max_log_ratio, 0.0)
        bounded: Float64 = np.clip(log_ratio, -self.tuning.max_log_ratio, most)
        return bounded

    def believe(self, tracks: TrackTable, rows: Int, log_ratio: Float64) -> None:
        """Write the probability of moving of the rows, and the means of both hypotheses of all tracks."""
        p = tracks.moving_probability[rows]
        tracks.moving_probability[rows] = p / (p + (1 - p) * np.exp(-log_ratio))
        self.combine(tracks)

    def combine(self, tracks: TrackTable) -> None:
        """Write state, velocity and covariances: the means of both hypotheses by their probabilities.

        The heading of what moves is that of its velocity; a track that rests keeps the heading that it had.
        """
        self._combine(tracks)
        moves = (tracks.moving_probability > 0.5).nonzero()[0]
        velocity = tracks.velocity.take(moves, axis=0)
        tracks.x[moves, HEADING] = np.arctan2(velocity[:, 1], velocity[:, 0])

    def _predict(self, tracks: TrackTable, step: Step, resting_share: Float64, moving_share: Float64) -> None:
        """Mix the hypotheses by shares (M,) of the other one, and predict both."""
        tuning = self.tuning
        m, P = components_first(tracks.moving_mean, tracks.moving_covariance)
        r, S = components_first(tracks.resting_mean, tracks.resting_covariance)
        mixed = _mixed(m, P, *_started(r, S, tuning.start_sigma_mps**2), resting_share)
        resting = _mixed(r, S, m[:VELOCITY], P[:VELOCITY, :VELOCITY], moving_share)
        _write(tracks.moving_mean, tracks.moving_covariance, *_moved(*mixed, step.dt_s, tuning))
        creep = tuning.creep_mps**2 * step.dt_s
        for i in IN_PLANE:
            resting[1][i, i] += creep
        _write(tracks.resting_mean, tracks.resting_covariance, *resting)

    def _update(self, tracks: TrackTable, rows: Int, position: Float64, noise: Float64) -> tuple[Fit, Fit]:
        """Update both hypotheses; how well the moving and the resting one expected the positions."""
        fits = []
        z, R = components_first(position, noise)
        for mean, covariance in (
            (tracks.moving_mean, tracks.moving_covariance),
            (tracks.resting_mean, tracks.resting_covariance),
        ):
            x, P = components_first(mean.take(rows, axis=0), covariance.take(rows, axis=0))
            x, P, fit = _filtered(x, P, z, R)
            mean[rows] = x.T
            covariance[rows] = P.transpose(2, 0, 1)
            fits.append(fit)
        return fits[0], fits[1]

    def _combine(self, tracks: TrackTable) -> None:
        """Write the means of both hypotheses, all but the heading."""
        m, C = components_first(tracks.moving_mean, tracks.moving_covariance)
        r, S = components_first(tracks.resting_mean, tracks.resting_covariance)
        mean, covariance = _mixed(*_started(r, S, 0.0), m, C, tracks.moving_probability)
        vx, vy = mean[VELOCITY:]
        speed = np.sqrt(vx * vx + vy * vy)
        tracks.x[:, :VELOCITY] = mean[:VELOCITY].T
        tracks.x[:, SPEED] = speed
        tracks.velocity[:] = mean[VELOCITY:].T
        tracks.velocity_covariance[:] = covariance[VELOCITY:, VELOCITY:].transpose(2, 0, 1)
        ahead = np.stack([np.ones_like(speed), np.zeros_like(speed)])
        np.divide(mean[VELOCITY:], speed, out=ahead, where=speed > 0)
        along, across = _variances(covariance[VELOCITY:, VELOCITY:], ahead)
        # The variance of the heading is that of the velocity across it, over its square; pi^2 is an unknown heading.
        unknown = np.pi * np.pi
        heading = np.full(len(speed), unknown)
        np.divide(across, speed * speed, out=heading, where=across < unknown * (speed * speed))
        tracks.P[:] = 0.0
        tracks.P[:, :VELOCITY, :VELOCITY] = covariance[:VELOCITY, :VELOCITY].transpose(2, 0, 1)
        tracks.P[:, HEADING, HEADING] = heading
        tracks.P[:, SPEED, SPEED] = along


def _variances(C: Float64, ahead: Float64) -> tuple[Float64, Float64]:
    """(M,) variances along a direction (2, M) and across it, of a covariance (2, 2, M)."""
    x, y = ahead
    xx, xy, yy = C[0, 0], C[0, 1], C[1, 1]
    return (xx * x + xy * y) * x + (xy * x + yy * y) * y, (xx * y - xy * x) * y + (yy * x - xy * y) * x


def _write(mean: Float64, covariance: Float64, x: Float64, P: Float64) -> None:
    """Write (n, M) and (n, n, M) to columns of the table."""
    mean[:] = x.T
    covariance[:] = P.transpose(2, 0, 1)


def _started(r: Float64, S: Float64, speed_variance: float) -> tuple[Float64, Float64]:
    """State (4, M) and covariance of resting tracks that start, with an unknown velocity about zero."""
    x = np.zeros((N, r.shape[1]))
    x[:VELOCITY] = r
    P = np.zeros((N, N, r.shape[1]))
    P[:VELOCITY, :VELOCITY] = S
    P[VELOCITY, VELOCITY] = P[VELOCITY + 1, VELOCITY + 1] = speed_variance
    return x, P


def _mixed(x: Float64, P: Float64, other: Float64, other_P: Float64, share: Float64) -> tuple[Float64, Float64]:
    """Mean and covariance of a mixture with a share (M,) of another estimate."""
    step = other - x
    keep = 1 - share
    spread = share * keep
    return x + share * step, (keep * P + share * other_P) + spread * step[:, None] * step


def _moved(x: Float64, P: Float64, dt_s: float, tuning: MotionFilterTuning) -> tuple[Float64, Float64]:
    """States and covariances dt_s later at constant velocity, disturbed by a white acceleration.

    The acceleration ahead and the one to a side grow with the speed, each by a rate of its own.
    """
    x = x.copy()
    P = P.copy()
    v = x[VELOCITY:].copy()
    dt2 = dt_s * dt_s
    turn_variance = tuning.turn_sigma_radps**2
    across = tuning.acceleration_sigma_mps2**2 + turn_variance * (v[X] * v[X] + v[Y] * v[Y])
    ahead = tuning.relative_acceleration_sigma_per_s**2 - turn_variance
    for i in IN_PLANE:
        x[i] += dt_s * x[i + VELOCITY]
    # The motion: P becomes F P F', with the covariances from before it.
    velocity = P[VELOCITY:, VELOCITY:].copy()
    cross = P[:VELOCITY, VELOCITY:].copy()
    for i in IN_PLANE:
        for k in IN_PLANE:
            P[i, k] += dt_s * (cross[i, k] + cross[k, i]) + dt2 * velocity[i, k]
            P[i, k + VELOCITY] += dt_s * velocity[i, k]
    # The acceleration: `across` in every direction, and `ahead` more along the velocity.
    for i in IN_PLANE:
        for k in IN_PLANE:
            noise = (across if i == k else 0.0) + ahead * (v[i] * v[k])
            P[i, k] += dt2 * dt2 / 4 * noise
            P[i, k + VELOCITY] += dt2 * dt_s / 2 * noise
            P[i + VELOCITY, k + VELOCITY] += dt2 * noise
    P[VELOCITY:, :VELOCITY] = P[:VELOCITY, VELOCITY:].transpose(1, 0, 2)
    return x, P


def _filtered(x: Float64, P: Float64, z: Float64, R: Float64) -> tuple[Float64, Float64, Fit]:
    """States and covariances after positions z (2, M) of covariance R (2, 2, M), and how well they were expected."""
    xx = P[X, X] + R[X, X]
    xy = P[X, Y] + R[X, Y]
    yy = P[Y, Y] + R[Y, Y]
    determinant = xx * yy - xy * xy
    off_x = z[X] - x[X]
    off_y = z[Y] - x[Y]
    distance = ((yy * off_x - xy * off_y) * off_x + (xx * off_y - xy * off_x) * off_y) / determinant
    gain_x = (P[:, X] * yy - P[:, Y] * xy) / determinant
    gain_y = (P[:, Y] * xx - P[:, X] * xy) / determinant
    after = P - (gain_x[:, None] * P[X] + gain_y[:, None] * P[Y])
    symmetric = (after + after.transpose(1, 0, 2)) / 2
    return x + (gain_x * off_x + gain_y * off_y), symmetric, Fit(distance, determinant)


class NativeMotionFilter(MotionFilter):
    """`MotionFilter` in C (`modt.native`)."""

    def __init__(self, library: ctypes.CDLL, tuning: MotionFilterTuning) -> None:
        super().__init__(tuning)
        declare(library, "filter.c")
        self._library = library

    def _predict(self, tracks: TrackTable, step: Step, resting_share: Float64, moving_share: Float64) -> None:
        """Mix the hypotheses by shares (M,) of the other one, and predict both."""
        tuning = self.tuning
        self._library.modt_predict_motion(
            *_state(tracks),
            len(tracks),
            resting_share,
            moving_share,
            step.dt_s,
            tuning.start_sigma_mps**2,
            tuning.creep_mps**2 * step.dt_s,
            tuning.acceleration_sigma_mps2**2,
            tuning.relative_acceleration_sigma_per_s**2,
            tuning.turn_sigma_radps**2,
        )

    def _update(self, tracks: TrackTable, rows: Int, position: Float64, noise: Float64) -> tuple[Fit, Fit]:
        """Update both hypotheses; how well the moving and the resting one expected the positions."""
        fits = np.empty((2, 2, len(rows)))
        self._library.modt_update_motion(*_state(tracks), rows, len(rows), position, noise, fits)
        return Fit(*fits[0]), Fit(*fits[1])

    def _combine(self, tracks: TrackTable) -> None:
        """Write the means of both hypotheses, all but the heading."""
        self._library.modt_combine_motion(
            *_state(tracks),
            len(tracks),
            tracks.moving_probability,
            tracks.x,
            tracks.P,
            tracks.velocity,
            tracks.velocity_covariance,
        )


def _state(tracks: TrackTable) -> tuple[Float64, Float64, Float64, Float64]:
    """Columns of both hypotheses."""
    return tracks.moving_mean, tracks.moving_covariance, tracks.resting_mean, tracks.resting_covariance


def motion_filter_of(kernels: GeometryKernels, tuning: MotionFilterTuning) -> MotionFilter:
    """The filter: native if the kernels have a library, else in NumPy."""
    return MotionFilter(tuning) if kernels.library is None else NativeMotionFilter(kernels.library, tuning)
