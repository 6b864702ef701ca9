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
from modt.geometry.tuning import ShapeTuning
from modt.observations import Observations, StaticTracks
from modt.odometry.tuning import LandmarkTuning, RegistrationTuning
from modt.types import Bool, Float64, Int


@dataclass(frozen=True)
class Landmarks:
    """Stationary objects that observations are matched against; n rows.

    Attributes:
        kdop: (8, n) their k-DOPs [m, world].
        established: (n,) whether the k-DOP is a mean over several frames.
    """

    kdop: Float64
    established: Bool


class LandmarkMap:
    """Mean k-DOPs of stationary tracks, by track id.

    A landmark lies at the mean of its sightings, so that the error of one frame is not carried on.

    Args:
        tuning: how the means are kept.
    """

    def __init__(self, tuning: LandmarkTuning = LandmarkTuning()) -> None:
        self._tuning = tuning
        self.clear()

    def clear(self) -> None:
        """Forget all landmarks."""
        self._id = np.zeros(0, np.int64)
        self._frames = np.zeros(0, np.int64)
        self._held = np.zeros(0, np.bool_)
        self._mean = np.zeros((0, 8))

    def hold(self, track_id: Int) -> None:
        """Keep tracks (k,) as landmarks where they are, though they seem to move, for as long as they stay there.

        Poses that were wrong have moved them all. If the landmarks went on like this, so would registration.
        """
        self._held |= np.isin(self._id, track_id)
        self._frames[self._held] = np.maximum(self._frames[self._held], self._tuning.established_frames)

    def update(self, tracks: StaticTracks) -> Landmarks:
        """Add the last frame and return the landmarks; to be called once in each frame."""
        self._renumber(tracks.id)
        self._add(tracks)
        # The landmarks are the candidates among the tracks, in their order.
        candidates = (tracks.candidate | (self._held & tracks.observed)).nonzero()[0]
        rested = (tracks.stationary | self._held) & (self._frames >= self._tuning.established_frames)
        established = rested[candidates]
        kdop = tracks.predicted_kdop.take(candidates, axis=1)
        kdop[:, established] = self._mean[candidates[established]].T
        return Landmarks(kdop, established)

    def _renumber(self, track_id: Int) -> None:
        """Bring the rows into the order of (M,) ascending track ids. New tracks have no frames and a mean of zero."""
        frames = np.zeros(len(track_id), np.int64)
        held = np.zeros(len(track_id), np.bool_)
        mean = np.zeros((len(track_id), 8))
        known = np.isin(track_id, self._id, assume_unique=True)
        before = self._id.searchsorted(track_id[known])
        frames[known] = self._frames[before]
        held[known] = self._held[before]
        mean[known] = self._mean.take(before, axis=0)
        self._id = track_id
        self._frames = frames
        self._held = held
        self._mean = mean

    def _add(self, tracks: StaticTracks) -> None:
        """Add the k-DOPs of the tracks that the last frame showed to their means."""
        rows = tracks.observed.nonzero()[0]
        off = tracks.kdop.take(rows, axis=0) - self._mean.take(rows, axis=0)
        if self._held.any():
            far_m = np.hypot(*centres(off.T)[::2])  # x and y; the other axes are diagonal
            self._held[rows] &= (far_m < self._tuning.max_jump_m) & ~tracks.stationary[rows]
        stays = tracks.stationary[rows] | self._held[rows]
        frames = np.where(stays, self._frames[rows] + 1, 0)
        gain = np.maximum(1.0 / np.maximum(frames, 1), self._tuning.min_gain)[:, None]
        self._frames[rows] = frames
        self._mean[rows] += np.where(np.abs(off) < self._tuning.max_jump_m, gain, 1.0) * off


_SCALES = (8.0, 4.0, 2.0, 1.0, 1.0, 1.0, 1.0, 1.0)
"""Factors on the scale of the errors in the iterations of a fit, from coarse to fine against local minima."""
_COARSE_SCALES = _SCALES[:4]
"""Factors in the iterations of each fit of a wide search: the coarsest of them."""
_WIDE_ROUNDS = 4
"""Rounds of matching and fitting in a wide search."""
_MIN_LANDMARKS = 3
"""Fewest candidate pairs for which a motion is fitted, and fewest inliers that support it. A planar motion needs two
pairs, and the third one checks it. A fit may have fewer pairs than candidates: only those that are the best match of
both their landmark and their observation count."""


@dataclass(frozen=True)
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


def _best(*fits: Fit | None) -> Fit | None:
    """The fit with the most inliers, the first of equals; None if there is none."""
    return max((fit for fit in fits if fit is not None), key=lambda fit: fit.inliers, default=None)


@dataclass(frozen=True)
class _View:
    """Landmarks, and the observations that are to be brought onto them.

    Attributes:
        landmarks: stationary objects of the frames before.
        observations: proposals of the frame, placed by the predicted pose.
        jacobian: (3, 8, P) outward displacement of each end of their k-DOPs, per metre of x and y and per radian.
    """

    landmarks: Landmarks
    observations: Observations
    jacobian: Float64


class Registration:
    """Correction of a predicted pose by stationary objects.

    Args:
        kernels: passes over pairs.
        tuning: how a pose is fitted.

    Attributes:
        initialised: whether a motion was known once.
    """

    def __init__(
        self, kernels: GeometryKernels = NUMPY_GEOMETRY, tuning: RegistrationTuning = RegistrationTuning()
    ) -> None:
        self._kernels = kernels
        self._tuning = tuning
        self.initialised = False
        self._motion_known = False  # whether the last call of `correct` gave a motion with support
        self._inliers = 0  # of the fit of that call

    def support(self, landmarks: Landmarks, observations: Observations) -> Fit:
        """The best motion within reach that brings observations, as placed on trial, onto the landmarks.

        Nothing is remembered of it. Without enough pairs it has no inliers.
        """
        fit = self._solve_coarsely(_View(landmarks, observations, _jacobian(observations)), np.zeros(3))
        return Fit(np.zeros(3), 0, 0) if fit is None else fit

    def correct(
        self, landmarks: Landmarks, observations: Observations, motion_share: Float64 | float = 1.0
    ) -> Float64:
        """Motion in the world that brings the observations onto the landmarks.

        Args:
            landmarks: stationary objects of the frames before.
            observations: proposals of the frame, placed by the predicted pose.
            motion_share: (P,) share of the motion that applies to each observation, by the time of its view.

        Returns:
            (4, 4) motion of the pose: the best fit, however few its inliers are. It is the identity if fewer than
            _MIN_LANDMARKS candidate pairs are within reach, or if the fit exceeds `reach_m` or `max_turn_rad`.
        """
        view = _View(landmarks, observations, _jacobian(observations) * motion_share)
        fit = None
        if self._motion_known:
            fit = self._solve(view, np.zeros(3), self._tuning.gate_m, _SCALES, match_rounds=1)
        if fit is None or not self._is_convincing(fit):
            fit = _best(fit, self._solve_wide(view))
        self._inliers = 0 if fit is None else fit.inliers
        self._motion_known = fit is not None and fit.supported(self._tuning.min_agreement)
        self.initialised |= self._motion_known
        if fit is None:
            return np.eye(4)
        if np.hypot(*fit.motion[:2]) > self._tuning.reach_m or abs(fit.motion[2]) > self._tuning.max_turn_rad:
            self._motion_known = False
            return np.eye(4)
        return _turn_about_sensor(fit.motion, observations.sensor_xy)

    def _is_convincing(self, fit: Fit) -> bool:
        """Whether most pairs of a fit agree, and its inliers are at least `inlier_drop` of those of the last fit."""
        enough = self._tuning.inlier_drop * self._inliers
        return fit.supported(self._tuning.inlier_ratio) and fit.inliers >= enough

    def _solve_wide(self, view: _View) -> Fit | None:
        """Motion within reach of the predicted one."""
        fit = self._solve_coarsely(view, np.zeros(3))
        if fit is None or fit.supported(self._tuning.min_agreement):
            return fit
        return _best(fit, self._solve_coarsely(view, fit.motion))  # once more, from where it arrived

    def _solve_coarsely(self, view: _View, motion: Float64) -> Fit | None:
        """Motion within reach of a given one, matched several times, with the coarsest scales of the errors."""
        return self._solve(view, motion, self._tuning.reach_m, _COARSE_SCALES, _WIDE_ROUNDS)

    def _solve(
        self, view: _View, motion: Float64, reach_m: float, scales: tuple[float, ...], match_rounds: int
    ) -> Fit | None:
        """Motion fitted to pairs within reach of a given motion, matched anew in each round."""
        landmarks = view.landmarks
        observations = view.observations
        placed = observations.kdop + np.tensordot(motion, view.jacobian, 1)
        landmark, observation = self._pairs_within(reach_m, landmarks.kdop, placed)
        if len(landmark) < _MIN_LANDMARKS:
            return None
        # From here on columns are pairs of a landmark and an observation.
        target = landmarks.kdop.take(landmark, axis=1)
        start = observations.kdop.take(observation, axis=1)
        jacobian = view.jacobian.take(observation, axis=2)
        outward_shift = start - target
        variance = self._variance(landmarks.established[landmark], observations.range_m[observation])
        tuning = self._kernels.shape_tuning
        for _ in range(match_rounds):
            moved = start + np.tensordot(motion, jacobian, 1)
            size, overlap = shape_similarity(target, moved, tuning)
            best = _mutual_best(landmark, observation, _distance(target, moved, tuning) + size - overlap)
            shift = outward_shift.take(best, axis=1)
            motion = _fit(shift, jacobian.take(best, axis=2), variance[best], motion, scales)
        moved = start.take(best, axis=1) + np.tensordot(motion, jacobian.take(best, axis=2), 1)
        distance = _distance(target.take(best, axis=1), moved, tuning)
        return Fit(motion, int((distance < self._tuning.inlier_m).sum()), len(best))

    def _pairs_within(self, reach_m: float, a: Float64, b: Float64) -> tuple[Int, Int]:
        """Indices of k-DOPs a (8, n) and b (8, k) whose centres are within reach of one another, along x and y."""
        centre_a = centres(a)
        centre_b = centres(b)
        widened = np.concatenate([centre_a, -centre_a]) + reach_m
        return self._kernels.overlapping_pairs(widened, np.concatenate([centre_b, -centre_b]))

    def _variance(self, established: Bool, range_m: Float64) -> Float64:
        """(K,) square of the scale of the errors of the ends of each pair, by landmark and observation [m2]."""
        young_sigma_m = np.where(established, 0.0, self._tuning.young_sigma_m)
        end_sigma_m = self._tuning.end_sigma_m + self._tuning.end_sigma_per_m * range_m
        variance: Float64 = young_sigma_m**2 + end_sigma_m**2
        return variance


def _distance(a: Float64, b: Float64, tuning: ShapeTuning) -> Float64:
    """(K,) distance from k-DOPs a to b (8, K), one by one [m]."""
    shift = shift_between(a, b, tuning)
    distance: Float64 = np.hypot(shift[:, 0], shift[:, 1])
    return distance


def _jacobian(observations: Observations) -> Float64:
    """(3, 8, P) outward displacement of each end of the k-DOPs, per metre of x and y and per radian.

    A turn about the sensor shifts a k-DOP as a whole, as it does its centre. It does not turn its shape, which small
    turns hardly change.
    """
    x, y = (observations.position - observations.sensor_xy).T
    jacobian = np.empty((3, 8, len(x)))
    jacobian[:2] = DIRECTIONS[:, :, None]
    jacobian[2] = DIRECTIONS.T @ np.stack([-y, x])
    return jacobian


def _mutual_best(landmark: Int, observation: Int, cost: Float64) -> Int:
    """(B,) pairs that are the cheapest of their landmark and of their observation, ascending.

    Args:
        landmark: (K,) landmark of each pair.
        observation: (K,) its observation.
        cost: (K,) its cost; of equal ones the first pair counts as cheaper.
    """
    rank = np.empty(len(cost), np.int64)
    rank[cost.argsort(kind="stable")] = np.arange(len(cost))
    best: Bool = (rank == _least_of_group(rank, landmark)) & (rank == _least_of_group(rank, observation))
    return best.nonzero()[0]


def _least_of_group(rank: Int, group: Int) -> Int:
    """(K,) least of the ranks, which are below K, in the group of each."""
    least: Int = np.full(int(group.max(initial=-1)) + 1, len(rank))
    np.minimum.at(least, group, rank)
    of_group: Int = least[group]
    return of_group


_UPPER_ROW, _UPPER_COLUMN = np.triu_indices(3)
"""(6,) and (6,) elements of the upper triangle of a (3, 3) matrix, row by row."""
_PLACE_IN_UPPER = np.array([[0, 1, 2], [1, 3, 4], [2, 4, 5]])
"""(3, 3) place of each element of a symmetric matrix in its upper triangle."""


def _fit(
    outward_shift: Float64, jacobian: Float64, variance: Float64, motion: Float64, scales: tuple[float, ...]
) -> Float64:
    """Motion that undoes the displacement of the ends of k-DOPs, by iteratively reweighted least squares.

    An end that comes into view moves while the other stays, so each end has its own weight, by a Cauchy distribution.
    A millionth of the weights pulls towards no motion, that is towards the predicted pose, and keeps the normal
    equations regular.

    Args:
        outward_shift: (8, K) displacement of each end outward, from landmark to observation [m].
        jacobian: (3, 8, K), as in _jacobian.
        variance: (K,) square of the scale of each pair's errors [m2].
        motion: (3,) first guess.
        scales: factors to these scales, an iteration each.

    Returns:
        (3,) x, y [m] and turn [rad].
    """
    J = jacobian.reshape(3, -1)
    shift = outward_shift.ravel()
    variance = np.tile(variance, 8)
    # Weighted sums of these rows are the normal matrix J W J', its upper triangle, and the right side J W shift.
    products = np.concatenate([J[_UPPER_ROW] * J[_UPPER_COLUMN], J * shift])
    for scale in scales:
        # The inverse of the weight: the square of each end's residual, softened by that of its scale.
        softened = motion @ J
        softened += shift
        softened *= softened
        softened += scale**2 * variance
        sums = products @ (1.0 / softened)
        normal = sums.take(_PLACE_IN_UPPER)
        normal.flat[::4] += 1e-6 * (normal[0, 0] + normal[1, 1] + normal[2, 2])
        motion = -np.asarray(np.linalg.solve(normal, sums[6:]), np.float64)
    return motion


def _turn_about_sensor(motion: Float64, sensor_xy: Float64) -> Float64:
    """(4, 4) turn about the position of the sensor, then shift."""
    R = rotation_zyx(0.0, 0.0, motion[2])
    position = np.array([sensor_xy[0], sensor_xy[1], 0.0])
    return se3(R, position - R @ position + np.array([motion[0], motion[1], 0.0]))
