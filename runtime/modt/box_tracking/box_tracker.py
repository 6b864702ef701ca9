"""The tracker for whole boxes: detections that somebody else has made and classified.

What differs from proposals is what is known of a detection: its box is a guess at the whole object, so its centre is
the place, and it comes with a score. The score says how exact the centre is, and whether to believe in it at all: a
weak detection may continue a track but not begin it. Where nothing is known of the sensor's own motion, all objects
seem to share it, and their courses turn as it does; so the filter is a linear one, without a course.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.optimize import linear_sum_assignment

from modt.box_tracking import constant_velocity
from modt.config import BoxTrackingConfig
from modt.geometry import wrap
from modt.types import NONE, Bool, Float64, Int

LIMIT = 1.0
"""Cost of a pair at the edge of the gate."""


CONFIGS = {
    "Car": BoxTrackingConfig(),
    "Pedestrian": BoxTrackingConfig(sure=4.0, turn_gain=0.5),
    "Cyclist": BoxTrackingConfig(sure=1.0, range_bonus_per_m=0.0),
}
"""How far detections of each type can be trusted."""


def box_config(name: str) -> BoxTrackingConfig:
    """The configuration for a type of object."""
    return CONFIGS[name]


@dataclass(frozen=True, slots=True)
class Reported:
    """The objects of a frame.

    Attributes:
        id: (K,) of the tracks.
        box: (K, 7) smoothed, world frame.
        confidence: (K,) in the track so far, the higher the surer.
        source: (K,) detection that each was seen as, NONE where it is predicted.
    """

    id: Int
    box: Float64
    confidence: Float64
    source: Int


class BoxTracker:
    """Follows the boxes of one class.

    Args:
        config: its parameters.
    """

    def __init__(self, config: BoxTrackingConfig) -> None:
        self.config = config
        self._next_id = 0
        self._stamp_s: float | None = None
        self._start(0)

    def _start(self, n: int) -> None:
        self._id, self._hits, self._missed = (np.zeros(n, np.int64) for _ in range(3))
        self._source = np.zeros(n, np.int64)
        self._x, self._P = np.zeros((n, 4)), np.zeros((n, 3))
        self._box, self._trust = np.zeros((n, 7)), np.zeros(n)

    def follow(self, stamp_s: float, boxes: Float64, score: Float64, range_m: Float64) -> Reported:
        """Take a frame's detections to the tracks.

        Args:
            stamp_s: time of the frame [s].
            boxes: (D, 7) detections in the world frame.
            score: (D,) how sure the detector is of each, the higher the surer.
            range_m: (D,) of each from the sensor [m].
        """
        variance = np.square(self.config.position_sigma_m * np.exp(-np.maximum(score, 0.0) / self.config.score_scale))
        trust = score + self.config.range_bonus_per_m * range_m  # few points on what is far: a low score by right
        self._predict(stamp_s)
        strong = score >= self.config.strong_score
        rows, columns = self._match(boxes, variance, strong)
        self._source[:] = NONE
        self._missed += 1
        if len(rows):
            self._update(rows, columns, boxes, variance, trust)
        free = strong.copy()
        free[columns] = False
        keep = self._missed <= self.config.max_missed
        if not keep.all() or free.any():
            self._renew(keep, np.flatnonzero(free), boxes, variance, trust)
        return self._report()

    def _predict(self, stamp_s: float) -> None:
        dt_s = 0.0 if self._stamp_s is None else max(0.0, stamp_s - self._stamp_s)
        self._stamp_s = stamp_s
        self._x, self._P = constant_velocity.predict(self._x, self._P, self.config.acceleration_sigma_mps2, dt_s)

    def _match(self, boxes: Float64, variance: Float64, strong: Bool) -> tuple[Int, Int]:
        """Rows and detections that belong together: the strong ones first, the weak ones among what is left."""
        if not len(self._id) or not len(boxes):
            return np.zeros(0, np.int64), np.zeros(0, np.int64)
        cost = self._cost(boxes, variance)
        if strong.all():
            return assign_all(cost, LIMIT)
        rows, columns = assign_all(np.where(strong, cost, LIMIT), LIMIT)
        cost[rows], cost[:, strong] = LIMIT, LIMIT
        more, weak = assign_all(cost, LIMIT)
        return np.concatenate([rows, more]), np.concatenate([columns, weak])

    def _cost(self, boxes: Float64, variance: Float64) -> Float64:
        """(T, D) of each pair, LIMIT and more beyond the gate."""
        dx, dy = boxes[:, 0] - self._x[:, 0, None], boxes[:, 1] - self._x[:, 1, None]
        reach = self.config.gate * (self._P[:, :1] + variance) + np.square(self.config.overlap * self._box[:, 3:4])
        rise = np.abs(boxes[:, 2] - self._box[:, 2, None])
        turn = np.abs(np.sin(boxes[:, 6] - self._box[:, 6, None]))
        cost: Float64 = (dx * dx + dy * dy) / reach + 0.2 * rise + 0.1 * turn
        return cost

    def _update(self, rows: Int, columns: Int, boxes: Float64, variance: Float64, trust: Float64) -> None:
        seen = boxes.take(columns, axis=0)
        x, P = self._x.take(rows, axis=0), self._P.take(rows, axis=0)
        self._x[rows], self._P[rows] = constant_velocity.update(x, P, seen[:, :2], variance[columns])
        self._missed[rows] = 0
        self._source[rows] = columns
        hits = self._hits[rows] + 1
        box = self._box.take(rows, axis=0)
        gain = np.maximum(1.0 / hits, self.config.smoothing)
        box[:, 3:6] += gain[:, None] * (seen[:, 3:6] - box[:, 3:6])
        box[:, 2] += self.config.height_gain * (seen[:, 2] - box[:, 2])
        turn = wrap(seen[:, 6] - box[:, 6])
        about = np.abs(turn) > np.pi / 2
        turn = np.where(about, wrap(turn + np.pi), turn)  # headings that do not flip
        box[:, 6] = wrap(box[:, 6] + self.config.turn_gain * turn)
        self._hits[rows], self._box[rows] = hits, box
        gain = np.maximum(1.0 / hits, self.config.score_gain)
        self._trust[rows] += gain * (trust[columns] - self._trust[rows])

    def _renew(self, keep: Bool, born: Int, boxes: Float64, variance: Float64, trust: Float64) -> None:
        n = len(born)
        x = np.zeros((n, 4))
        x[:, :2] = boxes[born, :2]
        P = np.zeros((n, 3))
        P[:, 0], P[:, 2] = variance[born], np.square(self.config.initial_speed_sigma_mps)
        join = np.concatenate
        self._id = join([self._id[keep], self._next_id + np.arange(n)])
        self._next_id += n
        self._hits = join([self._hits[keep], np.ones(n, np.int64)])
        self._missed = join([self._missed[keep], np.zeros(n, np.int64)])
        self._source = join([self._source[keep], born])
        self._x = join([self._x[keep], x])
        self._P = join([self._P[keep], P])
        self._box = join([self._box[keep], boxes[born]])
        self._trust = join([self._trust[keep], trust[born]])

    def _report(self) -> Reported:
        confidence = self._trust + self.config.age_bonus * np.log(self._hits)
        rows = np.flatnonzero((confidence >= self.config.sure) & (self._missed <= self.config.report_missed))
        box = self._box[rows]
        box[:, :2] = self._x[rows, :2]
        return Reported(self._id[rows], box, confidence[rows], self._source[rows])


def assign_all(cost: Float64, limit: float) -> tuple[Int, Int]:
    """Rows and columns of a least-cost assignment of few to few; cost (n, k), not those of limit or more."""
    rows, columns = linear_sum_assignment(np.minimum(cost, limit))
    chosen = cost[rows, columns] < limit
    return rows[chosen], columns[chosen]
