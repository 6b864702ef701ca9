"""Ego-motion from the proposals themselves, where the robot has no odometry.

Most proposals are static background: the planar motion that brings most of them onto the tracks they belong to is
the sensor's own.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from modt.geometry import rotation_zyx, se3
from modt.tracking.followed import Followed
from modt.tracking.outlines import WAYS, middles, touching
from modt.tracking.robust import carried, compare, likeness
from modt.tracking.shifts import shift_between
from modt.tracking.sightings import Sightings
from modt.types import Float64, Int

REACH_M = 2.5
"""How far the prediction may be off at its first frame."""
GATE_M = 0.8
"""How far it may be off once the motion is known."""
VOTE_M = 0.25
"""Side of a cell in which shifts are counted."""
ALIKE = 0.5
"""Difference of size beyond which a pair has no vote."""
SCALE_M = 0.08
"""Residuals beyond this lose their say (Cauchy)."""
ROUNDS = 4
INLIER_M = 0.2
"""A landmark this near to where it should be agrees."""
AGREEMENT = 0.3
"""Part of the landmarks that must agree for the prediction to be trusted next time."""
CONSENT = 0.75
"""Part that must agree lest the prediction is mistrusted and pairs are sought farther away."""
STOOD = 3
"""Frames from which the mean of what stands is its place."""
TURN_RAD = 0.2
"""Greatest turn of a correction."""
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

    def correct(self, tracks: Followed, sightings: Sightings) -> Float64:
        """(4, 4) motion in the world that brings the sightings onto the tracks; identity where nothing says so."""
        fit = self._solve(tracks, sightings, GATE_M, choices=1) if self._settled else None
        if fit is None or not fit.shared_by(CONSENT):  # the prediction may be off: look farther
            wide = self._solve(tracks, sightings, REACH_M, choices=ROUNDS)
            if fit is None or (wide is not None and wide.agree > fit.agree):
                fit = wide
        self._settled = fit is not None and fit.shared_by(AGREEMENT)
        self._begun |= self._settled
        if fit is None:
            return np.eye(4)
        if np.hypot(*fit.motion[:2]) > REACH_M or abs(fit.motion[2]) > TURN_RAD:
            self._settled = False
            return np.eye(4)
        return _about(fit.motion, sightings.eye)

    def _solve(self, tracks: Followed, sightings: Sightings, reach_m: float, choices: int) -> Fit | None:
        """The motion that most landmarks within reach say; pairs are chosen anew in the first rounds."""
        rows, known = landmarks(tracks)
        i, j = _pairs(known, sightings.outline, reach_m)
        if len(i) < MINIMUM:
            return None
        motion = np.zeros(3)
        if not self._begun:
            shift, size, _, _ = compare(known[:, i], sightings.outline[:, j])
            motion[:2] = -_vote(shift[size < ALIKE])
        levers = sightings.place - sightings.eye
        variance = 0.05**2 + tracks.P[rows, 0, 0]
        for k in range(ROUNDS):
            lever = levers.take(j, axis=0)
            carry = (motion[:2] + motion[2] * _turned(lever)) @ WAYS
            a, b = known.take(i, axis=1), sightings.outline.take(j, axis=1) + carry.T
            shift = shift_between(a, b)
            error = np.hypot(shift[:, 0], shift[:, 1])
            best = np.arange(len(i))
            if k < choices:
                size, overlap, _ = likeness(a, b)
                best = _mutual(i, j, error + size - overlap)
            weight = 1.0 / (variance[i[best]] + (0.003 * sightings.range_m[j[best]]) ** 2)
            motion = motion + _fit(shift.take(best, axis=0), lever.take(best, axis=0), weight)
            if choices == 1:
                i, j, error = i[best], j[best], error[best]
        agree = error if choices == 1 else error[best]
        return Fit(motion, int((agree < INLIER_M).sum()), len(agree))


def landmarks(tracks: Followed) -> tuple[Int, Float64]:
    """Rows of what stands or may, and their (8, n) outlines.

    What has stood for a while lies where it was seen on average, not where it was seen last: then an error of one
    frame is not handed on to all that follow.
    """
    rows = np.flatnonzero((tracks.still | (tracks.hits < 3)) & (tracks.missed <= 2))
    outline = carried(tracks).take(rows, axis=1)
    known = (tracks.still & (tracks.stood >= STOOD))[rows]
    outline[:, known] = tracks.landmark[rows[known]].T
    return rows, outline


def _pairs(a: Float64, b: Float64, reach: float) -> tuple[Int, Int]:
    """Indices of outlines a and b whose middles are within reach of one another, along x and along y."""
    middle_a, middle_b = (np.concatenate([middle, -middle]) for middle in (middles(a), middles(b)))
    return touching(middle_a + reach, middle_b)


def _turned(lever: Float64) -> Float64:
    """(K, 2) how a small turn moves what is at the end of each lever, per radian."""
    return np.stack([-lever[:, 1], lever[:, 0]], axis=1)


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


def _fit(shift: Float64, lever: Float64, weight: Float64) -> Float64:
    """(3,) x, y [m] and turn [rad] that undo the shifts (K, 2), by weighted least squares, outliers discounted.

    The normal equations are sums of the same products in every round, weighted anew; their block of x and y is a
    multiple of the identity, so that they are solved in a line each.
    """
    (sx, sy), (tx, ty) = shift.T, _turned(lever).T
    products = np.stack([np.ones(len(sx)), tx, ty, tx * tx + ty * ty, sx, sy, tx * sx + ty * sy])
    x = y = turn = 0.0
    for _ in range(3):
        left = np.square(sx + x + turn * tx) + np.square(sy + y + turn * ty)
        n, a, b, c, p, q, r = (products @ (weight / (1 + left / SCALE_M**2))).tolist()
        little = 1e-6 * (2 * n + c)
        n, c = n + little, c + little
        turn = ((a * p + b * q) / n - r) / (c - (a * a + b * b) / n)
        x, y = -(p + a * turn) / n, -(q + b * turn) / n
    return np.array([x, y, turn])


def _about(motion: Float64, eye: Float64) -> Float64:
    """(4, 4) turn about the sensor's place, then shift."""
    R = rotation_zyx(0.0, 0.0, motion[2])
    place = np.array([eye[0], eye[1], 0.0])
    return se3(R, place - R @ place + np.array([motion[0], motion[1], 0.0]))
