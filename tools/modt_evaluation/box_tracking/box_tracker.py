"""Tracker of classified boxes in two passes by score as in ByteTrack (Zhang et al., ECCV 2022).

The box of a detection covers the whole object, so its centre is the measured position; its score sets the variance of
that position. Detections of high score are associated first; the others may continue a track but not start one. The
Kalman filter is linear, without a heading: without ego-motion every track shares the rotation of the sensor.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
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


POSITION_SIGMA_M = 0.2
"""Standard deviation of a detected centre of score zero."""
SCORE_SCALE = 10.0
"""Increase of the score that divides that deviation by e."""
ACCELERATION_SIGMA_MPS2 = 10.0
"""Process noise, which covers the sensor's own motion where no poses are given."""
INITIAL_SPEED_SIGMA_MPS = 10.0
"""Standard deviation of the speed of a new track along each axis."""
SIZE_GAIN = 0.3
"""Least weight of a new size; more adapts to a detector faster."""
HEIGHT_GAIN = 0.7
"""Weight of a new height of the centre."""
MAX_COST = 1.0
"""Cost of a pair at the edge of the gate."""
GATE = 13.8
"""Squared Mahalanobis distance at the edge: the 0.999 quantile of chi2(2)."""
LENGTH_SHARE = 0.7
"""Share of the length of the box that is added to the radius of the gate."""
HEIGHT_WEIGHT_PER_M = 0.2
"""Cost of a difference of height."""
YAW_WEIGHT = 0.1
"""Cost of the absolute sine of a difference of yaw."""
MIN_BIRTH_SCORE = 0.0
"""Least score of a detection that starts a track."""
MAX_MISSED = 30
"""Frames without a detection after which a track is deleted."""
SCORE_GAIN = 0.5
"""Least weight of a new score in the confidence."""
AGE_BONUS = 0.5
"""Increase of the confidence per unit of the logarithm of the number of detections."""


@dataclass(frozen=True, kw_only=True)
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


@dataclass(frozen=True)
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


TRACK = np.dtype(
    [
        ("id", int),
        ("hits", int),  # number of its detections
        ("missed", int),  # frames since the last one
        ("source", int),  # index of the detection in this frame, NONE without one
        ("x", float, 4),  # state
        ("P", float, 3),  # covariance
        ("box", float, 7),  # smoothed; the position is that of the state
        ("score", float),  # smoothed score
        ("reach", float),  # variance of the position when it was last detected, by which the gate is sized
    ]
)


class BoxTracker:
    """Tracks the boxes of one class."""

    def __init__(self, config: BoxClass) -> None:
        self.config = config
        self._tracks = np.zeros(0, TRACK)
        self._next_id = 0
        self._stamp_s: float | None = None

    def step(self, stamp_s: float, boxes: Float64, score: Float64, range_m: Float64) -> BoxTracks:
        """Update the tracks with the detections of a frame: boxes (D, 7) in the world frame.

        Scores (D,) increase with the detector's confidence; range_m (D,) is that from the sensor.
        """
        variance = np.square(POSITION_SIGMA_M * np.exp(-np.maximum(score, 0.0) / SCORE_SCALE))
        ranged_score = score + self.config.range_bonus_per_m * range_m
        self._predict(stamp_s)
        strong = score >= MIN_BIRTH_SCORE
        rows, columns = self._match(boxes, variance, strong)
        self._tracks["source"] = NONE
        self._tracks["missed"] += 1
        self._update(rows, columns, boxes, variance, ranged_score)
        unmatched = strong.copy()
        unmatched[columns] = False
        kept = self._tracks[self._tracks["missed"] <= MAX_MISSED]
        self._tracks = np.concatenate([kept, self._born(np.flatnonzero(unmatched), boxes, variance, ranged_score)])
        return self._report()

    def _predict(self, stamp_s: float) -> None:
        tracks = self._tracks
        dt_s = 0.0 if self._stamp_s is None else max(0.0, stamp_s - self._stamp_s)
        self._stamp_s = stamp_s
        tracks["x"], tracks["P"] = predict(tracks["x"], tracks["P"], ACCELERATION_SIGMA_MPS2, dt_s)
        # A gate that widens while a track is missed would in the end accept the detection of another object.
        np.copyto(tracks["reach"], tracks["P"][:, 0], where=tracks["missed"] == 0)

    def _match(self, boxes: Float64, variance: Float64, strong: Bool) -> tuple[Int, Int]:
        """Rows and detections of the pairs: strong detections first, the others with the remaining tracks."""
        cost = self._cost(boxes, variance)
        if strong.all():
            return assign(cost)
        rows, columns = assign(np.where(strong, cost, MAX_COST))
        cost[rows] = MAX_COST
        cost[:, strong] = MAX_COST
        more_rows, more_columns = assign(cost)
        return np.concatenate([rows, more_rows]), np.concatenate([columns, more_columns])

    def _cost(self, boxes: Float64, variance: Float64) -> Float64:
        """(T, D) cost of each pair."""
        box = self._tracks["box"][:, None]
        dx, dy = (boxes[:, :2] - self._tracks["x"][:, None, :2]).transpose(2, 0, 1)
        gate_m2 = GATE * (self._tracks["reach"][:, None] + variance) + np.square(LENGTH_SHARE * box[..., 3])
        dz = np.abs(boxes[:, 2] - box[..., 2])
        turn = np.abs(np.sin(boxes[:, 6] - box[..., 6]))
        return np.asarray((dx * dx + dy * dy) / gate_m2 + HEIGHT_WEIGHT_PER_M * dz + YAW_WEIGHT * turn)

    def _update(self, rows: Int, columns: Int, boxes: Float64, variance: Float64, score: Float64) -> None:
        """Correct the tracks of some rows by their detections."""
        tracks = self._tracks[rows]
        measured = boxes[columns]
        tracks["x"], tracks["P"] = update(tracks["x"], tracks["P"], measured[:, :2], variance[columns])
        tracks["missed"] = 0
        tracks["source"] = columns
        tracks["hits"] += 1
        box = tracks["box"]
        gain = np.maximum(1.0 / tracks["hits"], SIZE_GAIN)
        box[:, 3:6] += gain[:, None] * (measured[:, 3:6] - box[:, 3:6])
        box[:, 2] += HEIGHT_GAIN * (measured[:, 2] - box[:, 2])
        turn = wrap(measured[:, 6] - box[:, 6])
        turn = np.where(np.abs(turn) > np.pi / 2, wrap(turn + np.pi), turn)  # yaw is ambiguous by pi
        box[:, 6] = wrap(box[:, 6] + self.config.yaw_gain * turn)
        gain = np.maximum(1.0 / tracks["hits"], SCORE_GAIN)
        tracks["score"] += gain * (score[columns] - tracks["score"])
        self._tracks[rows] = tracks

    def _born(self, new: Int, boxes: Float64, variance: Float64, score: Float64) -> NDArray[np.void]:
        """New tracks of some detections."""
        tracks = np.zeros(len(new), TRACK)
        tracks["id"] = self._next_id + np.arange(len(new))
        self._next_id += len(new)
        tracks["hits"] = 1
        tracks["source"] = new
        tracks["x"][:, :2] = boxes[new, :2]
        tracks["P"][:, 0] = variance[new]
        tracks["P"][:, 2] = INITIAL_SPEED_SIGMA_MPS**2
        tracks["box"] = boxes[new]
        tracks["score"] = score[new]
        return tracks

    def _report(self) -> BoxTracks:
        """The tracks that are detected in this frame, if the confidence suffices."""
        tracks = self._tracks[self._tracks["source"] != NONE]
        confidence = tracks["score"] + AGE_BONUS * np.log(tracks["hits"])
        reported = confidence >= self.config.report_above
        tracks = tracks[reported]
        tracks["box"][:, :2] = tracks["x"][:, :2]
        return BoxTracks(tracks["id"], tracks["box"], confidence[reported], tracks["source"])
