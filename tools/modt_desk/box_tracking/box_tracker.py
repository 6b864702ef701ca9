"""Tracker of classified boxes, in two passes by score as in ByteTrack (Zhang et al., ECCV 2022).

The box of a detection covers the whole object, so its centre is the measured position; its score sets the variance of
that position. Detections of high score are associated first; the others may continue a track but not start one. The
motion model is linear, without a heading: without ego-motion every track shares the rotation of the sensor.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.optimize import linear_sum_assignment

from modt.geometry import wrap
from modt.types import NONE, Bool, Float64, Int
from modt_desk.box_tracking import constant_velocity
from modt_desk.box_tracking.config import BoxTrackingConfig

MAX_COST = 1.0
"""Cost of a pair at the edge of the gate."""


@dataclass(frozen=True, slots=True)
class BoxTracks:
    """Reported tracks of a frame."""

    id: Int  # (K,) of the tracks
    box: Float64  # (K, 7) smoothed, world frame
    confidence: Float64  # (K,) in the track
    source: Int  # (K,) index of the associated detection


def assign(cost: Float64) -> tuple[Int, Int]:
    """Rows and columns of a least-cost assignment; cost (n, k), pairs of MAX_COST and more are forbidden."""
    rows, columns = linear_sum_assignment(np.minimum(cost, MAX_COST))
    allowed = cost[rows, columns] < MAX_COST
    return rows[allowed], columns[allowed]


class BoxTracker:
    """Tracks the boxes of one class."""

    def __init__(self, config: BoxTrackingConfig) -> None:
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
        model = self.config.filter
        variance = np.square(model.position_sigma_m * np.exp(-np.maximum(score, 0.0) / model.score_scale))
        # Few points lie on what is far: its score is low for that reason alone.
        ranged_score = score + self.config.confidence.range_bonus_per_m * range_m
        self._predict(stamp_s)
        strong = score >= self.config.min_birth_score
        rows, columns = self._match(boxes, variance, strong)
        self._source[:] = NONE
        self._missed += 1
        if len(rows):
            self._update(rows, columns, boxes, variance, ranged_score)
        unmatched = strong.copy()
        unmatched[columns] = False
        keep = self._missed <= self.config.max_missed
        if not keep.all() or unmatched.any():
            self._delete_and_create(keep, np.flatnonzero(unmatched), boxes, variance, ranged_score)
        return self._report()

    def _predict(self, stamp_s: float) -> None:
        dt_s = 0.0 if self._stamp_s is None else max(0.0, stamp_s - self._stamp_s)
        self._stamp_s = stamp_s
        sigma = self.config.filter.acceleration_sigma_mps2
        self._x, self._P = constant_velocity.predict(self._x, self._P, sigma, dt_s)
        # A gate that widened while a track is missed would end by taking the detection of something else.
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
        config = self.config.association
        dx, dy = boxes[:, 0] - self._x[:, 0, None], boxes[:, 1] - self._x[:, 1, None]
        gate_m2 = config.gate * (self._reach[:, None] + variance) + np.square(config.length_share * self._box[:, 3:4])
        dz = np.abs(boxes[:, 2] - self._box[:, 2, None])
        turn = np.abs(np.sin(boxes[:, 6] - self._box[:, 6, None]))
        return np.asarray((dx * dx + dy * dy) / gate_m2 + config.height_weight_per_m * dz + config.yaw_weight * turn)

    def _update(self, rows: Int, columns: Int, boxes: Float64, variance: Float64, score: Float64) -> None:
        model, measured = self.config.filter, boxes.take(columns, axis=0)
        x, P = self._x.take(rows, axis=0), self._P.take(rows, axis=0)
        self._x[rows], self._P[rows] = constant_velocity.update(x, P, measured[:, :2], variance[columns])
        self._missed[rows] = 0
        self._source[rows] = columns
        hits = self._hits[rows] + 1
        box = self._box.take(rows, axis=0)
        gain = np.maximum(1.0 / hits, model.size_gain)
        box[:, 3:6] += gain[:, None] * (measured[:, 3:6] - box[:, 3:6])
        box[:, 2] += model.height_gain * (measured[:, 2] - box[:, 2])
        turn = wrap(measured[:, 6] - box[:, 6])
        turn = np.where(np.abs(turn) > np.pi / 2, wrap(turn + np.pi), turn)  # yaw is ambiguous by pi
        box[:, 6] = wrap(box[:, 6] + model.yaw_gain * turn)
        self._hits[rows], self._box[rows] = hits, box
        gain = np.maximum(1.0 / hits, self.config.confidence.score_gain)
        self._score[rows] += gain * (score[columns] - self._score[rows])

    def _delete_and_create(self, keep: Bool, new: Int, boxes: Float64, variance: Float64, score: Float64) -> None:
        n = len(new)
        x, P = np.zeros((n, 4)), np.zeros((n, 3))
        x[:, :2] = boxes[new, :2]
        P[:, 0], P[:, 2] = variance[new], np.square(self.config.filter.initial_speed_sigma_mps)
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
        config = self.config.confidence
        rows = np.flatnonzero(self._source != NONE)
        confidence = self._score[rows] + config.age_bonus * np.log(self._hits[rows])
        sure = confidence >= config.report_above
        rows = rows[sure]
        box = self._box[rows]
        box[:, :2] = self._x[rows, :2]
        return BoxTracks(self._id[rows], box, confidence[sure], self._source[rows])
