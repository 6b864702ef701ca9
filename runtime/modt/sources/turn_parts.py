"""Joining of messages that each hold a part of a turn of the head."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from modt.ros2.point_cloud2 import PointCloud
from modt.types import DESKEWED, Float32, Float64

BINS = 360
"""Number of bearings at which it is noted whether there are points."""
MIN_POINTS = 64
"""Messages of fewer points do not tell what they cover."""
WHOLE_RAD = np.deg2rad(300.0)
"""Messages that cover at least this angle are whole turns [rad]."""
MIN_PAIRS = 4
"""Number of pairs of consecutive messages from which parts are known."""
MIN_SHARE = 0.6
"""Share of these pairs in which one message continues the other."""
TOLERANCE_RAD = np.deg2rad(12.0)
TOLERANCE_SHARE = 0.25
"""Angle by which the begin of a part may miss the end of the one before [rad], and as a share of the part."""
MARGIN_RAD = 0.1
"""Angle before the begin of a part in which points still belong to it [rad]."""
MAX_GAP_TURNS = 1.5
"""Time without a message after which a turn is not continued, if messages have no stamps [turns]."""
MAX_PHASE = 2.5 * np.pi
"""Phase that the head has reached by the stamp of a part if it has begun another turn [rad]."""
CLOCKWISE = 1.0


@dataclass(frozen=True)
class Arc:
    """Bearings that a message covers, counter-clockwise from `low_rad` on [rad]."""

    low_rad: float
    extent_rad: float

    def begin_rad(self, way: float) -> float:
        """Bearing at which a head that turns clockwise (way 1) or not (-1) begins it."""
        return self.low_rad + self.extent_rad if way == CLOCKWISE else self.low_rad

    def end_rad(self, way: float) -> float:
        """Bearing at which it ends it."""
        return self.begin_rad(-way)


def arc_of(points: Float32) -> Arc:
    """The arc that the points of a message cover: all but the widest gap between bearings with points."""
    x, y = points[:, :2].T
    used = (x != 0) | (y != 0)
    if np.count_nonzero(used) < MIN_POINTS:
        return Arc(-np.pi, 2 * np.pi)
    bearing = np.arctan2(y[used], x[used])
    filled = np.unique(((bearing + np.pi) * (BINS / (2 * np.pi))).astype(np.int64) % BINS)
    gaps = np.diff(filled, append=filled[0] + BINS)  # from each to the next
    widest = int(np.argmax(gaps))
    low = filled[(widest + 1) % len(filled)] * (2 * np.pi / BINS) - np.pi
    return Arc(float(low), float(2 * np.pi - (gaps[widest] - 1) * (2 * np.pi / BINS)))


class TurnParts:
    """Joins parts of turns to whole ones, which begin and end behind the sensor.

    A turn is stamped when the head faces straight ahead, by the stamps of its parts and the speed of the head.

    Attributes:
        turn_s: duration of a turn, as in Frame.
        n_parts: number of messages in a turn.
        late: number of parts that came after their turn was complete, and are in none.
    """

    def __init__(self, way: float, turn_s: float, n_parts: float) -> None:
        """`way`: 1 for a head that turns clockwise, -1 for others."""
        self.turn_s = way * turn_s
        self.n_parts = n_parts
        self.late = 0
        self._way = way
        self._points: list[Float32] = []
        self._marks: list[tuple[float, float]] = []  # time [s] and phase since behind the sensor [rad] of each part
        self._first = True
        self._frame_id = ""

    @staticmethod
    def may_be(clouds: Sequence[PointCloud]) -> bool:
        """Whether the first messages of a source may be parts of turns."""
        return bool(np.median([arc_of(cloud.points).extent_rad for cloud in clouds]) < WHOLE_RAD)

    @classmethod
    def of(cls, messages: Sequence[tuple[PointCloud, float]]) -> TurnParts | None:
        """Joiner of the messages of a source, by the first ones and their arrivals [s]; None if they are no parts."""
        messages = sorted(messages, key=lambda message: message[0].began_s or message[1])
        clouds = [cloud for cloud, _ in messages]
        one_sensor = len({cloud.frame_id for cloud in clouds}) == 1
        if len(clouds) <= MIN_PAIRS or not one_sensor or not cls.may_be(clouds):
            return None
        arcs = [arc_of(cloud.points) for cloud in clouds]
        shares = {way: _continued(arcs, way) for way in (CLOCKWISE, -CLOCKWISE)}
        way = max(shares, key=lambda w: shares[w])
        if shares[way] < MIN_SHARE:
            return None
        if min(shares.values()) >= MIN_SHARE:  # halves: each continues the other both ways
            way = _order(clouds)
        times_s = np.array([cloud.began_s or arrived_s for cloud, arrived_s in messages])
        begins = np.array([arc.begin_rad(way) for arc in arcs])
        steps_rad = np.mod(way * (begins[:-1] - begins[1:]), 2 * np.pi)
        turned_rad = float(steps_rad.sum())
        if turned_rad <= 0 or times_s[-1] <= times_s[0]:
            return None
        return cls(way, float(times_s[-1] - times_s[0]) * 2 * np.pi / turned_rad, 2 * np.pi / float(steps_rad.mean()))

    def note(self) -> str:
        """Line for the user."""
        what = f"its messages are parts of a turn of {abs(self.turn_s):.3f} s"
        return f"{what}: about {self.n_parts:.3g} are joined to a sweep"

    def add(self, cloud: PointCloud, arrived_s: float) -> PointCloud | None:
        """The turn that a message completes; None if it completes none."""
        self._frame_id = cloud.frame_id
        time_s = cloud.began_s or arrived_s
        turn_s = abs(self.turn_s)
        arc = arc_of(cloud.points)
        phase = float(np.mod(np.pi - self._way * arc.begin_rad(self._way), 2 * np.pi))
        phase, another = self._place(cloud, time_s, phase)
        if phase < -MARGIN_RAD:
            self.late += 1
            return None
        phase = max(phase, 0.0)
        done = self._turn(cloud.frame_id) if another else None
        bearing = np.arctan2(cloud.points[:, 1], cloud.points[:, 0]).astype(np.float64)
        since_begin = np.mod(np.pi - self._way * bearing - phase + MARGIN_RAD, 2 * np.pi) - MARGIN_RAD
        beyond = phase + since_begin >= 2 * np.pi
        self._points.append(cloud.points[~beyond])
        self._marks.append((time_s, phase))
        if beyond.any() and done is None:
            done = self._turn(cloud.frame_id)
            self._points.append(cloud.points[beyond])
            self._marks.append((time_s + (2 * np.pi - phase) / (2 * np.pi) * turn_s, 0.0))
        return done

    def _place(self, cloud: PointCloud, time_s: float, phase: float) -> tuple[float, bool]:
        """Phase at the begin of a part in the turn of those before, and whether it begins another turn [rad]."""
        if not self._marks:
            return phase, False
        last_s, last_phase = max(self._marks)
        since_turns = (time_s - last_s) / abs(self.turn_s)
        reached = last_phase + 2 * np.pi * since_turns  # phase that the head has reached by the stamp
        if since_turns < 0:  # late, maybe by turns: the phase nearest to the one at which the head was
            return float(phase - 2 * np.pi * np.rint((phase - reached) / (2 * np.pi))), False
        # Arrivals tell less than stamps: by them, only a long gap ends a turn.
        passed = reached > MAX_PHASE if cloud.began_s else since_turns > MAX_GAP_TURNS
        return phase, passed or phase < last_phase - MARGIN_RAD

    def finish(self) -> PointCloud | None:
        """The last turn, if only the message after it is missing."""
        if not self._marks or self._marks[-1][1] < 2 * np.pi * (1 - 1.5 / max(self.n_parts, 2.0)):
            return None
        return self._turn(self._frame_id)

    def _turn(self, frame_id: str) -> PointCloud | None:
        """The parts so far as a turn; None for the first one if it began within a turn."""
        points = np.concatenate(self._points)
        times_s, phases = np.array(self._marks).T
        whole = not self._first or phases[0] < TOLERANCE_SHARE * 2 * np.pi / self.n_parts
        ahead_s = float((times_s + (np.pi - phases) / (2 * np.pi) * abs(self.turn_s)).mean())
        self._points = []
        self._marks = []
        self._first = False
        return PointCloud(ahead_s, frame_id, points, self.turn_s, times=DESKEWED) if whole else None


def _continued(arcs: Sequence[Arc], way: float) -> float:
    """Share of the arcs that begin where the one before ends, for a head that turns a way."""
    fitting = [
        abs(np.angle(np.exp(1j * (b.begin_rad(way) - a.end_rad(way)))))
        <= max(TOLERANCE_RAD, TOLERANCE_SHARE * min(a.extent_rad, b.extent_rad))
        for a, b in pairwise(arcs)
    ]
    return float(np.mean(fitting))


def _order(clouds: Sequence[PointCloud]) -> float:
    """Way in which the bearing changes in the order of the points; clockwise if there is no order."""
    trend = 0.0
    for cloud in clouds:
        x, y, _, _ = cloud.points[(cloud.points[:, 0] != 0) | (cloud.points[:, 1] != 0)].T.astype(np.float64)
        if len(x) < MIN_POINTS:
            continue
        low = arc_of(cloud.points).low_rad
        bearing: Float64 = np.mod(np.arctan2(y, x) - low + MARGIN_RAD, 2 * np.pi)
        trend += float(np.corrcoef(bearing, np.arange(len(x)))[0, 1])
    return -CLOCKWISE if trend > 0.5 * len(clouds) else CLOCKWISE
