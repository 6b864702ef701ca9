"""Tracker of classified boxes in two passes by score as in ByteTrack (Zhang et al., ECCV 2022).

The box of a detection covers the whole object, so its centre is the measured position; its score sets the variance of
that position. Detections of high score are associated first; the others may continue a track but not start one. The
Kalman filter is linear, without a heading: without ego-motion every track shares the rotation of the sensor.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.optimize import linear_sum_assignment

from modt.classes import ObjectClass
from modt.geometry import wrap
from modt.types import NONE, Bool, Float64, Int


def predict(x: Float64, P: Float64, acceleration_sigma_mps2: float, dt_s: float) -> tuple[Float64, Float64]:
    """States (M, 4) and covariances (M, 3) after dt_s, with white acceleration constant within dt_s.

    A state is x, y, vx, vy in m and m/s. Both axes share one covariance: var(position), cov(position, velocity),
    var(velocity).
    """
    predicted = x.copy()
    predicted[:, :2] += dt_s * x[:, 2:]
    pp, pv, vv = P.T
    q = (acceleration_sigma_mps2 * dt_s) ** 2
    covariance = [pp + 2 * dt_s * pv + dt_s**2 * vv + dt_s**2 / 4 * q, pv + dt_s * vv + dt_s / 2 * q, vv + q]
    return predicted, np.stack(covariance, axis=1)


def update(x: Float64, P: Float64, z: Float64, variance: Float64) -> tuple[Float64, Float64]:
    """States and covariances after measured positions z (M, 2) of variance (M,) [m2] along each axis."""
    gain = P[:, :2] / (P[:, 0] + variance)[:, None]  # gains of position and velocity
    nu = z - x[:, :2]
    updated = x + np.concatenate([gain[:, :1] * nu, gain[:, 1:] * nu], axis=1)
    return updated, P - np.stack([gain[:, 0] * P[:, 0], gain[:, 0] * P[:, 1], gain[:, 1] * P[:, 1]], axis=1)


POSITION_SIGMA_M, SCORE_SCALE = 0.2, 10.0
"""Standard deviation of a detected centre of score zero, and the increase of the score that divides it by e."""
ACCELERATION_SIGMA_MPS2 = 10.0
"""Process noise, which covers the sensor's own motion where no poses are given."""
INITIAL_SPEED_SIGMA_MPS = 10.0
"""Standard deviation of the speed of a new track along each axis."""
SIZE_GAIN, HEIGHT_GAIN = 0.3, 0.7
"""Least weights of a new size and of a new height of the centre; more follows a detector faster."""
MAX_COST = 1.0
"""Cost of a pair at the edge of the gate."""
GATE, LENGTH_SHARE = 13.8, 0.7
"""Squared Mahalanobis distance at the edge (0.999 quantile of chi2(2)); share of the length added to its radius."""
HEIGHT_WEIGHT_PER_M, YAW_WEIGHT = 0.2, 0.1
"""Cost of a difference of height, and of the absolute sine of a difference of yaw."""
MIN_BIRTH_SCORE = 0.0
"""Least score of a detection that starts a track."""
MAX_MISSED = 30
"""Frames without a detection after which a track is deleted."""
SCORE_GAIN, AGE_BONUS = 0.5, 0.5
"""Least weight of a new score in the confidence, and what it gains per unit of the logarithm of the detections."""


@dataclass(frozen=True, slots=True, kw_only=True)
class BoxClass:
    """Parameters that differ between classes. Confidences are on the scale of PointRCNN's scores."""

    report_above: float = 1.0  # least confidence of a track in a frame in which it is reported
    keep_above: float  # least mean confidence of a track that is written
    range_bonus_per_m: float = 0.0  # added to a score per metre, since few points lower the score of a far object
    yaw_gain: float = 0.7  # weight of a new yaw
    max_gap: int = 3  # frames without a report that are filled afterwards


BOX_CLASSES = {
    ObjectClass.CAR: BoxClass(report_above=6.5, keep_above=8.5, range_bonus_per_m=0.1),
    ObjectClass.PEDESTRIAN: BoxClass(keep_above=3.8, yaw_gain=0.5, max_gap=1),
    ObjectClass.CYCLIST: BoxClass(keep_above=4.2),
}
"""Tuned on PointRCNN's detections on KITTI."""


@dataclass(frozen=True, slots=True)
class BoxTracks:
    """Reported tracks of a frame."""

    id: Int  # (K,) identities of the tracks
    box: Float64  # (K, 7) smoothed, world frame
    confidence: Float64  # (K,) confidence in the track
    source: Int  # (K,) index of the associated detection


def assign(cost: Float64) -> tuple[Int, Int]:
    """Rows and columns of a least-cost assignment; cost (n, k), pairs of MAX_COST and more are forbidden."""
    rows, columns = linear_sum_assignment(np.minimum(cost, MAX_COST))
    allowed = cost[rows, columns] < MAX_COST
    return rows[allowed], columns[allowed]


class BoxTracker:
    """Tracks the boxes of one class."""

    def __init__(self, config: BoxClass) -> None:
        self.config = config
        self._next_id = 0
        self._stamp_s: float | None = None
        self._id, self._hits, self._missed, self._source = (np.zeros(0, np.int64) for _ in range(4))
        self._x, self._P = np.zeros((0, 4)), np.zeros((0, 3))
        self._box, self._score, self._reach = np.zeros((0, 7)), np.zeros(0), np.zeros(0)

    def step(self, stamp_s: float, boxes: Float64, score: Float64, range_m: Float64) -> BoxTracks:
        """Update the tracks with the detections of a frame: boxes (D, 7) in the world frame.

        Scores (D,) increase with the detector's confidence; range_m (D,) is that from the sensor.
        """
        variance = np.square(POSITION_SIGMA_M * np.exp(-np.maximum(score, 0.0) / SCORE_SCALE))
        ranged_score = score + self.config.range_bonus_per_m * range_m
        self._predict(stamp_s)
        strong = score >= MIN_BIRTH_SCORE
        rows, columns = self._match(boxes, variance, strong)
        self._source[:] = NONE
        self._missed += 1
        if len(rows):
            self._update(rows, columns, boxes, variance, ranged_score)
        unmatched = strong.copy()
        unmatched[columns] = False
        keep = self._missed <= MAX_MISSED
        if not keep.all() or unmatched.any():
            self._delete_and_create(keep, np.flatnonzero(unmatched), boxes, variance, ranged_score)
        return self._report()

    def _predict(self, stamp_s: float) -> None:
        dt_s = 0.0 if self._stamp_s is None else max(0.0, stamp_s - self._stamp_s)
        self._stamp_s = stamp_s
        self._x, self._P = predict(self._x, self._P, ACCELERATION_SIGMA_MPS2, dt_s)
        # A gate that widens while a track is missed would in the end accept the detection of another object.
        np.copyto(self._reach, self._P[:, 0], where=self._missed == 0)

    def _match(self, boxes: Float64, variance: Float64, strong: Bool) -> tuple[Int, Int]:
        """Rows and detections of the pairs: strong detections first, the others with the remaining tracks."""
        if not len(self._id) or not len(boxes):
            return np.zeros(0, np.int64), np.zeros(0, np.int64)
        cost = self._cost(boxes, variance)
        if strong.all():
            return assign(cost)
        rows, columns = assign(np.where(strong, cost, MAX_COST))
        cost[rows], cost[:, strong] = MAX_COST, MAX_COST
        more_rows, more_columns = assign(cost)
        return np.concatenate([rows, more_rows]), np.concatenate([columns, more_columns])

    def _cost(self, boxes: Float64, variance: Float64) -> Float64:
        """(T, D) cost of each pair."""
        dx, dy = boxes[:, 0] - self._x[:, 0, None], boxes[:, 1] - self._x[:, 1, None]
        gate_m2 = GATE * (self._reach[:, None] + variance) + np.square(LENGTH_SHARE * self._box[:, 3:4])
        dz = np.abs(boxes[:, 2] - self._box[:, 2, None])
        turn = np.abs(np.sin(boxes[:, 6] - self._box[:, 6, None]))
        return np.asarray((dx * dx + dy * dy) / gate_m2 + HEIGHT_WEIGHT_PER_M * dz + YAW_WEIGHT * turn)

    def _update(self, rows: Int, columns: Int, boxes: Float64, variance: Float64, score: Float64) -> None:
        measured = boxes.take(columns, axis=0)
        x, P = self._x.take(rows, axis=0), self._P.take(rows, axis=0)
        self._x[rows], self._P[rows] = update(x, P, measured[:, :2], variance[columns])
        self._missed[rows] = 0
        self._source[rows] = columns
        hits = self._hits[rows] + 1
        box = self._box.take(rows, axis=0)
        gain = np.maximum(1.0 / hits, SIZE_GAIN)
        box[:, 3:6] += gain[:, None] * (measured[:, 3:6] - box[:, 3:6])
        box[:, 2] += HEIGHT_GAIN * (measured[:, 2] - box[:, 2])
        turn = wrap(measured[:, 6] - box[:, 6])
        turn = np.where(np.abs(turn) > np.pi / 2, wrap(turn + np.pi), turn)  # yaw is ambiguous by pi
        box[:, 6] = wrap(box[:, 6] + self.config.yaw_gain * turn)
        self._hits[rows], self._box[rows] = hits, box
        gain = np.maximum(1.0 / hits, SCORE_GAIN)
        self._score[rows] += gain * (score[columns] - self._score[rows])

    def _delete_and_create(self, keep: Bool, new: Int, boxes: Float64, variance: Float64, score: Float64) -> None:
        n = len(new)
        x, P = np.zeros((n, 4)), np.zeros((n, 3))
        x[:, :2] = boxes[new, :2]
        P[:, 0], P[:, 2] = variance[new], np.square(INITIAL_SPEED_SIGMA_MPS)
        join = np.concatenate
        self._id = join([self._id[keep], self._next_id + np.arange(n)])
        self._next_id += n
        self._hits = join([self._hits[keep], np.ones(n, np.int64)])
        self._missed = join([self._missed[keep], np.zeros(n, np.int64)])
        self._source = join([self._source[keep], new])
        self._x = join([self._x[keep], x])
        self._P = join([self._P[keep], P])
        self._box = join([self._box[keep], boxes[new]])
        self._score = join([self._score[keep], score[new]])
        self._reach = join([self._reach[keep], np.zeros(n)])

    def _report(self) -> BoxTracks:
        rows = np.flatnonzero(self._source != NONE)
        confidence = self._score[rows] + AGE_BONUS * np.log(self._hits[rows])
        reported = confidence >= self.config.report_above
        rows = rows[reported]
        box = self._box[rows]
        box[:, :2] = self._x[rows, :2]
        return BoxTracks(self._id[rows], box, confidence[reported], self._source[rows])
