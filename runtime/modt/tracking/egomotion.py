"""Ego-motion from the proposals themselves, where the robot has no odometry.

Most proposals are static background: the planar motion that brings most of them onto the tracks they belong to is
the sensor's own.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from modt.geometry import rotation_zyx, se3
from modt.tracking.followed import Followed
from modt.tracking.robust import carried, compare
from modt.tracking.sightings import AXES, Sightings
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
        rows, low, high = landmarks(tracks)
        i, j = _pairs(low, high, sightings, reach_m)
        if len(i) < MINIMUM:
            return None
        motion = np.zeros(3)
        if not self._begun:
            shift, size, _, _ = compare(low[i], high[i], sightings.low[j], sightings.high[j])
            motion[:2] = -_vote(shift[size < ALIKE])
        for k in range(ROUNDS):
            lever = sightings.place[j] - sightings.eye
            carry = (motion[:2] + motion[2] * _turned(lever)) @ AXES
            shift, size, overlap, _ = compare(low[i], high[i], sightings.low[j] + carry, sightings.high[j] + carry)
            error = np.hypot(shift[:, 0], shift[:, 1])
            best = _mutual(i, j, error + size - overlap) if k < choices else np.arange(len(i))
            weight = 1.0 / (0.05**2 + tracks.P[rows[i[best]], 0, 0] + (0.003 * sightings.range_m[j[best]]) ** 2)
            motion = motion + _fit(shift[best], lever[best], weight)
            if choices == 1:
                i, j, error = i[best], j[best], error[best]
        agree = error if choices == 1 else error[best]
        return Fit(motion, int((agree < INLIER_M).sum()), len(agree))


def landmarks(tracks: Followed) -> tuple[Int, Float64, Float64]:
    """Rows of what stands or may, and (n, 4) least and (n, 4) greatest coordinates of their outlines.

    What has stood for a while lies where it was seen on average, not where it was seen last: then an error of one
    frame is not handed on to all that follow.
    """
    rows = np.flatnonzero((tracks.still | (tracks.hits < 3)) & (tracks.missed <= 2))
    low, high = (a[rows] for a in carried(tracks))
    known = (tracks.still & (tracks.stood >= STOOD))[rows]
    low[known], high[known] = tracks.stood_low[rows[known]], tracks.stood_high[rows[known]]
    return rows, low, high


def _pairs(low: Float64, high: Float64, sightings: Sightings, reach: float) -> tuple[Int, Int]:
    near = np.ones((len(low), len(sightings)), np.bool_)
    for axis in (0, 2):
        middle = ((low[:, axis] + high[:, axis]) / 2).astype(np.float32)
        other = ((sightings.low[:, axis] + sightings.high[:, axis]) / 2).astype(np.float32)
        near &= np.abs(middle[:, None] - other) < np.float32(reach)
    i, j = np.divmod(np.flatnonzero(near), max(len(sightings), 1))
    return i, j


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
    order = np.argsort(cost, kind="stable")
    first_i = np.zeros(len(cost), np.bool_)
    first_j = np.zeros(len(cost), np.bool_)
    first_i[order[np.unique(i[order], return_index=True)[1]]] = True
    first_j[order[np.unique(j[order], return_index=True)[1]]] = True
    return np.flatnonzero(first_i & first_j)


def _fit(shift: Float64, lever: Float64, weight: Float64) -> Float64:
    """(3,) x, y [m] and turn [rad] that undo the shifts (K, 2), by weighted least squares, outliers discounted."""
    motion = np.zeros(3)
    turned = _turned(lever)
    for _ in range(3):
        left = shift + motion[:2] + motion[2] * turned
        w = weight / (1 + (left**2).sum(axis=1) / SCALE_M**2)
        A = np.zeros((3, 3))
        A[0, 0] = A[1, 1] = w.sum()
        A[:2, 2] = A[2, :2] = w @ turned
        A[2, 2] = w @ (lever**2).sum(axis=1)
        b = np.append(w @ shift, (w[:, None] * turned * shift).sum())
        motion = -np.linalg.solve(A + 1e-6 * np.eye(3) * np.trace(A), b)
    return motion


def _about(motion: Float64, eye: Float64) -> Float64:
    """(4, 4) turn about the sensor's place, then shift."""
    R = rotation_zyx(0.0, 0.0, motion[2])
    place = np.array([eye[0], eye[1], 0.0])
    return se3(R, place - R @ place + np.array([motion[0], motion[1], 0.0]))
