"""Ego-motion from the proposals themselves, where the robot has no odometry.

Most proposals are static background: the planar motion that brings most of them onto the tracks they belong to is
the sensor's own.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from modt.geometry import rotation_zyx, se3
from modt.geometry.kdop import DIRECTIONS, centres, overlapping_pairs
from modt.observations import Observations
from modt.odometry import landmarks
from modt.tracking.displacement import shift_between
from modt.tracking.kdop_association import compare, shape_similarity
from modt.tracking.track_table import TrackTable
from modt.types import Float64, Int

REACH_M = 2.5
"""How far the prediction may be off at its first frame."""
GATE_M = 0.8
"""How far it may be off once the motion is known."""
VOTE_M = 0.25
"""Side of a cell in which shifts are counted."""
ALIKE = 0.5
"""Difference of size beyond which a pair has no vote."""
END_M, END_SPREAD = 0.02, 0.0007
"""How far the ends of a landmark are off, near by and more for each metre of range: beyond, an end loses its say."""
YOUNG_M = 0.07
"""How much more those of what has no mean outline yet."""
SCALES = (8.0, 4.0, 2.0, 1.0, 1.0, 1.0, 1.0, 1.0)
"""A fit begins as if everything were off by so many times more, lest it ends where few ends agree by chance."""
ROUNDS = 4
"""Times that pairs are chosen anew where the prediction may be far off, with as many of the scales each time."""
INLIER_M = 0.2
"""A landmark this near to where it should be agrees."""
AGREEMENT = 0.3
"""Part of the landmarks that must agree for the prediction to be trusted next time."""
INLIER_RATIO, INLIER_DROP = 0.75, 0.5
"""Part that must agree, and so many of those that agreed last time, lest the prediction is mistrusted and pairs are
sought farther away."""
TURN_RAD = 0.2
"""Greatest turn of a correction."""
OUTSET_RAD = (0.0, 0.05, -0.05, 0.1, -0.1, 0.15, -0.15)
"""Turns that are tried while nothing is known of the motion ..."""
OUTSET = 10
"""... in so many frames: they cost as many fits."""
MINIMUM = 3
"""Landmarks without which nothing is corrected."""


@dataclass(frozen=True, slots=True)
class Fit:
    """A motion, and how many of the landmarks agree with it.

    Attributes:
        motion: (3,) x, y [m] and turn [rad].
        agree: landmarks that are where they should be after it.
        landmarks: those that it was fitted to.
    """

    motion: Float64
    agree: int
    landmarks: int

    def shared_by(self, part: float) -> bool:
        """Whether more than this part of the landmarks agree."""
        return self.agree >= MINIMUM and self.agree > part * self.landmarks


class Registration:
    """Corrects a predicted pose by the proposals that stand still."""

    def __init__(self) -> None:
        self._begun = self._settled = False
        self._agreed = self._tried = 0

    def correct(self, tracks: TrackTable, observations: Observations, share: Float64 | float = 1.0) -> Float64:
        """The motion in the world that brings the sightings onto the tracks.

        Args:
            tracks: what stands where, among others.
            observations: a frame's, by the pose that is expected.
            share: of the motion, by which each of them goes (P,), as SweepSkew.share.

        Returns:
            (4, 4) motion of the pose; identity where nothing says so.
        """
        ways = _ways(observations) * share
        rest = np.zeros(3)
        fit = self._solve(tracks, observations, ways, rest, GATE_M, SCALES, choices=1) if self._settled else None
        sure = fit is not None and fit.shared_by(INLIER_RATIO) and fit.agree >= INLIER_DROP * self._agreed
        if not sure:  # the prediction may be off: look farther
            wide = self._look_far(tracks, observations, ways, rest)
            if self._begun and wide is not None and not wide.shared_by(AGREEMENT):  # it did not get there yet
                again = self._look_far(tracks, observations, ways, wide.motion)
                wide = again if again is not None and again.agree > wide.agree else wide
            if fit is None or (wide is not None and wide.agree > fit.agree):
                fit = wide
        self._agreed = 0 if fit is None else fit.agree
        self._settled = fit is not None and fit.shared_by(AGREEMENT)
        self._begun |= self._settled
        if fit is None:
            return np.eye(4)
        if np.hypot(*fit.motion[:2]) > REACH_M or abs(fit.motion[2]) > TURN_RAD:
            self._settled = False
            return np.eye(4)
        return _about(fit.motion, observations.sensor_xy)

    def _look_far(self, tracks: TrackTable, observations: Observations, ways: Float64, motion: Float64) -> Fit | None:
        """The motion that most landmarks say that are near after another motion, or after any turn at the outset."""
        outset = not self._begun and self._tried < OUTSET
        self._tried += outset and len(tracks) > 0
        starts = ([0.0, 0.0, turn] for turn in OUTSET_RAD) if outset else (motion,)
        fits = (
            self._solve(tracks, observations, ways, np.asarray(start), REACH_M, SCALES[:ROUNDS], choices=ROUNDS)
            for start in starts
        )
        return max((fit for fit in fits if fit is not None), key=lambda fit: fit.agree, default=None)

    def _solve(
        self,
        tracks: TrackTable,
        observations: Observations,
        ways: Float64,
        motion: Float64,
        reach_m: float,
        scales: tuple[float, ...],
        choices: int,
    ) -> Fit | None:
        """The motion that most landmarks within reach of one say, pairs chosen so many times; ways as of _ways."""
        rows, known = landmarks.places(tracks)
        near = observations.kdop + np.tensordot(motion, ways, 1)
        i, j = _pairs(known, near, reach_m)
        if len(i) < MINIMUM:
            return None
        if not self._begun:
            shift, size, _, _ = compare(known[:, i], near[:, j])
            motion = motion + np.append(-_vote(shift[size < ALIKE]), 0.0)
        a, b, ways = known.take(i, axis=1), observations.kdop.take(j, axis=1), ways.take(j, axis=2)
        gain, young = b - a, np.where(landmarks.stands(tracks), 0.0, YOUNG_M).take(rows)
        variance = young[i] ** 2 + (END_M + END_SPREAD * observations.range_m[j]) ** 2
        for _ in range(choices):
            gone = b + np.tensordot(motion, ways, 1)
            shift = shift_between(a, gone)
            size, overlap, _ = shape_similarity(a, gone)
            best = _mutual(i, j, np.hypot(shift[:, 0], shift[:, 1]) + size - overlap)
            motion = _fit(gain.take(best, axis=1), ways.take(best, axis=2), variance[best], motion, scales)
        a, b, ways = a.take(best, axis=1), b.take(best, axis=1), ways.take(best, axis=2)
        shift = shift_between(a, b + np.tensordot(motion, ways, 1))
        return Fit(motion, int((np.hypot(shift[:, 0], shift[:, 1]) < INLIER_M).sum()), len(best))


def _pairs(a: Float64, b: Float64, reach: float) -> tuple[Int, Int]:
    """Indices of outlines a and b whose middles are within reach of one another, along x and along y."""
    middle_a, middle_b = (np.concatenate([middle, -middle]) for middle in (centres(a), centres(b)))
    return overlapping_pairs(middle_a + reach, middle_b)


def _ways(observations: Observations) -> Float64:
    """(3, 8, P) how far a motion takes each end of the outlines outward, per metre of x and y and per radian."""
    x, y = (observations.position - observations.sensor_xy).T
    ways = np.empty((3, 8, len(x)))
    ways[:2] = DIRECTIONS[:, :, None]
    ways[2] = DIRECTIONS.T @ np.stack([-y, x])
    return ways


def _vote(shift: Float64) -> Float64:
    """(2,) shift that most pairs agree on, whole cells of it; none where there are none."""
    if not len(shift):
        return np.zeros(2)
    side = int(2 * REACH_M / VOTE_M) + 3
    cell = np.clip(np.rint(shift / VOTE_M).astype(np.int64) + side // 2, 1, side - 2)
    counts = np.bincount(cell[:, 0] * side + cell[:, 1], minlength=side * side).reshape(side, side)
    around = np.sum([np.roll(counts, (a, b), (0, 1)) for a in (-1, 0, 1) for b in (-1, 0, 1)], axis=0)
    row, column = divmod(int(np.argmax(around)), side)
    return np.array([row - side // 2, column - side // 2]) * VOTE_M


def _mutual(i: Int, j: Int, cost: Float64) -> Int:
    """Indices of the pairs that are the best of their row and of their column."""
    dearest_first = np.argsort(cost, kind="stable")[::-1]
    best_of_i, best_of_j = (np.empty(int(index.max(initial=0)) + 1, np.int64) for index in (i, j))
    best_of_i[i[dearest_first]] = best_of_j[j[dearest_first]] = dearest_first  # the last one written is the cheapest
    k = np.arange(len(cost))
    return np.flatnonzero((best_of_i[i] == k) & (best_of_j[j] == k))


def _fit(gain: Float64, ways: Float64, variance: Float64, motion: Float64, scales: tuple[float, ...]) -> Float64:
    """The motion that undoes what the ends of outlines gained, by least squares reweighted at each of the scales.

    An end that comes into view moves while the other stays. Each is a witness of its own, distributed as Cauchy has
    it: what the others do not confirm loses its say. A millionth of the weights says that all is as expected.

    Args:
        gain: (8, K) [m].
        ways: (3, 8, K), as of _ways.
        variance: (K,) square of the scale of each pair's ends [m2].
        motion: (3,) to begin with.
        scales: factors to these scales.

    Returns:
        (3,) x, y [m] and turn [rad].
    """
    J, g, variance = ways.reshape(3, -1), gain.ravel(), np.tile(variance, 8)
    products = np.concatenate([J[0] * J, J[1] * J[1:], J[2:] * J[2], g * J])
    for scale in scales:
        left = motion @ J
        left += g
        left *= left
        left += scale**2 * variance
        xx, xy, xt, yy, yt, tt, x, y, t = (products @ (1.0 / left)).tolist()
        little = 1e-6 * (xx + yy + tt)
        normal = np.array([[xx + little, xy, xt], [xy, yy + little, yt], [xt, yt, tt + little]])
        motion = -np.linalg.solve(normal, np.array([x, y, t]))
    return motion


def _about(motion: Float64, sensor_xy: Float64) -> Float64:
    """(4, 4) turn about the sensor's place, then shift."""
    R = rotation_zyx(0.0, 0.0, motion[2])
    position = np.array([sensor_xy[0], sensor_xy[1], 0.0])
    return se3(R, position - R @ position + np.array([motion[0], motion[1], 0.0]))
