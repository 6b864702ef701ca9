"""Ego-motion from the proposals, where the robot has no odometry.

Most proposals are static background. The planar motion that maps most of them onto their landmarks is the motion of
the sensor.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from modt.geometry import rotation_zyx, se3
from modt.geometry.kdop import DIRECTIONS, centres, shape_similarity, shift_between
from modt.geometry.kernels import NUMPY_GEOMETRY, GeometryKernels
from modt.observations import Observations, StaticTracks
from modt.types import Bool, Float64, Int


@dataclass(frozen=True, slots=True)
class Landmarks:
    """Stationary objects that observations are matched against; n rows.

    Attributes:
        kdop: (8, n) their k-DOPs [m, world].
        established: (n,) whether the k-DOP is a mean over several frames.
    """

    kdop: Float64
    established: Bool


ESTABLISHED_FRAMES = 3
"""Frames at rest from which the mean is the landmark's position."""
MIN_GAIN = 0.03
"""Least weight of a new view in the mean: a landmark follows a drift of the poses within about 33 frames."""
MAX_JUMP_M = 0.2
"""Distance of an end of a k-DOP from its mean beyond which that mean restarts [m]: another part is in view."""


class LandmarkMap:
    """Mean k-DOPs of stationary tracks, by track id; kept only while no poses are given.

    A landmark lies at the mean of its sightings, so that the error of one frame is not carried on.
    """

    def __init__(self) -> None:
        self.clear()

    def clear(self) -> None:
        """Forget all landmarks."""
        self._id = np.zeros(0, np.int64)
        self._frames = np.zeros(0, np.int64)
        self._mean = np.zeros((0, 8))

    def update(self, tracks: StaticTracks) -> Landmarks:
        """Add the last frame and return the landmarks; to be called once in each frame without a pose."""
        frames, mean = np.zeros(len(tracks.id), np.int64), np.zeros((len(tracks.id), 8))
        known = np.isin(tracks.id, self._id, assume_unique=True)
        before = self._id.searchsorted(tracks.id[known])
        frames[known], mean[known] = self._frames[before], self._mean.take(before, axis=0)
        rows = tracks.observed.nonzero()[0]
        frames[rows] = np.where(tracks.stationary[rows], frames[rows] + 1, 0)
        gain = np.maximum(1.0 / np.maximum(frames[rows], 1), MIN_GAIN)[:, None]
        off = tracks.kdop.take(rows, axis=0) - mean.take(rows, axis=0)
        mean[rows] += np.where(np.abs(off) < MAX_JUMP_M, gain, 1.0) * off
        self._id, self._frames, self._mean = tracks.id, frames, mean
        candidates = tracks.candidate.nonzero()[0]
        established = (tracks.stationary & (frames >= ESTABLISHED_FRAMES))[candidates]
        kdop = tracks.predicted_kdop.take(candidates, axis=1)
        kdop[:, established] = mean[candidates[established]].T
        return Landmarks(kdop, established)


REACH_M = 2.5
"""Greatest correction of a pose, and greatest error of the first prediction [m]. A larger one is refused."""
GATE_M = 0.8
"""Greatest error of a prediction once the motion is known [m]. Farther landmarks are no candidates."""
MAX_TURN_RAD = 0.2
"""Greatest turn of a correction [rad]. A larger one is refused."""
END_SIGMA_M, END_SIGMA_PER_M = 0.02, 0.0007
"""Scale of the error of an end of a k-DOP at range 0 [m], and its growth per metre of range."""
YOUNG_SIGMA_M = 0.07
"""Further error of a landmark without an established mean [m]; lowers its weight in the fit."""
INLIER_M = 0.2
"""Distance to its landmark within which an observation agrees with a motion [m]."""
MIN_AGREEMENT = 0.3
"""Share of inliers above which the motion is known and the next search is a near one."""
INLIER_RATIO, INLIER_DROP = 0.75, 0.5
"""Shares of inliers, of the pairs and of the last frame's inliers, below which pairs are sought farther away."""
INITIAL_TURN_RAD = 0.05
"""Step between the seven turns that are tried while no motion is known [rad]."""
_SCALES = (8.0, 4.0, 2.0, 1.0, 1.0, 1.0, 1.0, 1.0)
"""Factors on the scale of the errors in the iterations of a fit, from coarse to fine against local minima."""
_MATCH_ROUNDS = 4
"""Rounds of matching and fitting in a wide search, and number of the coarsest scales that each fit uses."""
_MIN_LANDMARKS = 3
"""Fewest pairs of a fit. A planar motion needs two, and the third one checks it."""


@dataclass(frozen=True, slots=True)
class Fit:
    """A motion and its support.

    Attributes:
        motion: (3,) x, y [m] and turn [rad].
        inliers: pairs that agree with it.
        pairs: number of pairs that it was fitted to.
    """

    motion: Float64
    inliers: int
    pairs: int

    def supported(self, min_inlier_share: float) -> bool:
        """Whether there are enough inliers, and more than this share of the pairs are."""
        return self.inliers >= _MIN_LANDMARKS and self.inliers > min_inlier_share * self.pairs


class Registration:
    """Correction of a predicted pose by stationary objects.

    Args:
        kernels: passes over pairs.
    """

    def __init__(self, kernels: GeometryKernels = NUMPY_GEOMETRY) -> None:
        self._kernels = kernels
        self._initialised = self._motion_known = False
        self._inliers = 0

    def correct(
        self, landmarks: Landmarks, observations: Observations, motion_share: Float64 | float = 1.0
    ) -> Float64:
        """Motion in the world that brings the observations onto the landmarks.

        Args:
            landmarks: stationary objects of the frames before.
            observations: proposals of the frame, placed by the predicted pose.
            motion_share: (P,) share of the motion that applies to each observation, by the time of its view.

        Returns:
            (4, 4) motion of the pose; identity without support for another one.
        """
        jacobian = _jacobian(observations) * motion_share
        rest = np.zeros(3)
        fit = None
        if self._motion_known:
            fit = self._solve(landmarks, observations, jacobian, rest, GATE_M, _SCALES, match_rounds=1)
        enough = INLIER_DROP * self._inliers
        if fit is None or not fit.supported(INLIER_RATIO) or fit.inliers < enough:  # search farther away
            wide_fit = self._search(landmarks, observations, jacobian, rest)
            if self._initialised and wide_fit is not None and not wide_fit.supported(MIN_AGREEMENT):
                retry = self._search(landmarks, observations, jacobian, wide_fit.motion)
                wide_fit = retry if retry is not None and retry.inliers > wide_fit.inliers else wide_fit
            if fit is None or (wide_fit is not None and wide_fit.inliers > fit.inliers):
                fit = wide_fit
        self._inliers = 0 if fit is None else fit.inliers
        self._motion_known = fit is not None and fit.supported(MIN_AGREEMENT)
        self._initialised |= self._motion_known
        if fit is None:
            return np.eye(4)
        if np.hypot(*fit.motion[:2]) > REACH_M or abs(fit.motion[2]) > MAX_TURN_RAD:
            self._motion_known = False
            return np.eye(4)
        return _turn_about_sensor(fit.motion, observations.sensor_xy)

    def _search(
        self, landmarks: Landmarks, observations: Observations, jacobian: Float64, motion: Float64
    ) -> Fit | None:
        """Motion with the most inliers near a given one, or near several turns while no motion is known."""
        initial = not self._initialised
        starts = [[0.0, 0.0, k * INITIAL_TURN_RAD] for k in (0, 1, -1, 2, -2, 3, -3)] if initial else [motion]
        scales = _SCALES[:_MATCH_ROUNDS]
        fits = (
            self._solve(landmarks, observations, jacobian, np.asarray(start), REACH_M, scales, _MATCH_ROUNDS)
            for start in starts
        )
        return max((fit for fit in fits if fit is not None), key=lambda fit: fit.inliers, default=None)

    def _solve(
        self,
        landmarks: Landmarks,
        observations: Observations,
        jacobian: Float64,
        motion: Float64,
        reach_m: float,
        scales: tuple[float, ...],
        match_rounds: int,
    ) -> Fit | None:
        """Motion fitted to pairs within reach of a given motion, matched anew in each round."""
        near = observations.kdop + np.tensordot(motion, jacobian, 1)
        i, j = self._pairs(landmarks.kdop, near, reach_m)
        if len(i) < _MIN_LANDMARKS:
            return None
        a, b, jacobian = landmarks.kdop.take(i, axis=1), observations.kdop.take(j, axis=1), jacobian.take(j, axis=2)
        outward_shift, young = b - a, np.where(landmarks.established, 0.0, YOUNG_SIGMA_M)
        sigma = END_SIGMA_M + END_SIGMA_PER_M * observations.range_m[j]
        variance = young[i] ** 2 + sigma**2
        for _ in range(match_rounds):
            moved = b + np.tensordot(motion, jacobian, 1)
            shift = shift_between(a, moved)
            size, overlap = shape_similarity(a, moved)
            best = _mutual(i, j, np.hypot(shift[:, 0], shift[:, 1]) + size - overlap)
            motion = _fit(
                outward_shift.take(best, axis=1), jacobian.take(best, axis=2), variance[best], motion, scales
            )
        a, b, jacobian = a.take(best, axis=1), b.take(best, axis=1), jacobian.take(best, axis=2)
        shift = shift_between(a, b + np.tensordot(motion, jacobian, 1))
        inliers = int((np.hypot(shift[:, 0], shift[:, 1]) < INLIER_M).sum())
        return Fit(motion, inliers, len(best))

    def _pairs(self, a: Float64, b: Float64, reach: float) -> tuple[Int, Int]:
        """Indices of k-DOPs a and b whose centres are within reach of one another, along x and along y."""
        middle_a, middle_b = (np.concatenate([middle, -middle]) for middle in (centres(a), centres(b)))
        return self._kernels.overlapping_pairs(middle_a + reach, middle_b)


def _jacobian(observations: Observations) -> Float64:
    """(3, 8, P) outward displacement of each end of the k-DOPs, per metre of x and y and per radian."""
    x, y = (observations.position - observations.sensor_xy).T
    jacobian = np.empty((3, 8, len(x)))
    jacobian[:2] = DIRECTIONS[:, :, None]
    jacobian[2] = DIRECTIONS.T @ np.stack([-y, x])
    return jacobian


def _mutual(i: Int, j: Int, cost: Float64) -> Int:
    """Indices of the pairs that are the best of their row and of their column."""
    worst_first = np.argsort(cost, kind="stable")[::-1]
    best_of_i, best_of_j = (np.empty(int(index.max(initial=0)) + 1, np.int64) for index in (i, j))
    best_of_i[i[worst_first]] = best_of_j[j[worst_first]] = worst_first  # the best is written last and remains
    k = np.arange(len(cost))
    return np.flatnonzero((best_of_i[i] == k) & (best_of_j[j] == k))


def _fit(
    outward_shift: Float64, jacobian: Float64, variance: Float64, motion: Float64, scales: tuple[float, ...]
) -> Float64:
    """Motion that undoes the displacement of the ends of k-DOPs, by iteratively reweighted least squares.

    An end that comes into view moves while the other stays, so each end has its own weight, by a Cauchy distribution.
    A millionth of the weights pulls towards no motion, which keeps the normal equations regular.

    Args:
        outward_shift: (8, K) displacement of each end outward, from landmark to observation [m].
        jacobian: (3, 8, K), as in _jacobian.
        variance: (K,) square of the scale of each pair's errors [m2].
        motion: (3,) first guess.
        scales: factors to these scales, an iteration each.

    Returns:
        (3,) x, y [m] and turn [rad].
    """
    J, shift, variance = jacobian.reshape(3, -1), outward_shift.ravel(), np.tile(variance, 8)
    products = np.concatenate([J[0] * J, J[1] * J[1:], J[2:] * J[2], shift * J])
    for scale in scales:
        left = motion @ J
        left += shift
        left *= left
        left += scale**2 * variance
        # Normal equations of x, y and turn t: weighted sums over products of two rows of J, or of one and the shift
        xx, xy, xt, yy, yt, tt, x, y, t = (products @ (1.0 / left)).tolist()
        little = 1e-6 * (xx + yy + tt)
        normal = np.array([[xx + little, xy, xt], [xy, yy + little, yt], [xt, yt, tt + little]])
        motion = -np.linalg.solve(normal, np.array([x, y, t]))
    return motion


def _turn_about_sensor(motion: Float64, sensor_xy: Float64) -> Float64:
    """(4, 4) turn about the position of the sensor, then shift."""
    R = rotation_zyx(0.0, 0.0, motion[2])
    position = np.array([sensor_xy[0], sensor_xy[1], 0.0])
    return se3(R, position - R @ position + np.array([motion[0], motion[1], 0.0]))
