"""Poses received from another process.

Stamps of poses and frames are on the clock of the stream, `stamp_s` of `tracks.jsonl`. No other clock is read: a
replay is reproducible if it receives the same poses before the same frames.
"""

from __future__ import annotations

import logging
from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from modt.config import OdometryConfig
from modt.sources.pose_buffer import MAX_AGE_S, PoseSequence
from modt.sources.pose_datagram import DatagramError
from modt.sources.pose_source import PoseSource
from modt.sources.stream import MAX_STAMP_S, unit_of
from modt.types import Float64, Frame

MAX_AHEAD_S = 60.0
"""Lead of a pose over its frame beyond which it is of another clock [s]."""
log = logging.getLogger(__name__)


class ReceivedPoses(PoseSource):
    """Poses that another process sends; refused ones are counted, and logged once of each kind.

    Poses are believed as `PoseSequence` says. A restarted sender with another world frame is passed on in
    `Frame.restarts`.
    """

    has_poses = True  # though frames may lack one
    REASONS = (
        *("malformed", "non_finite", "unit", "crowded_out", "stale", "ahead", "failed"),
        *("repeated", "out_of_order", "early", "leap"),  # doubts of PoseBuffer
    )
    """Reasons of a refusal; each has a counter."""

    def __init__(self, config: OdometryConfig, name: str) -> None:
        self.name = name
        self._poses = PoseSequence(config)
        self.received = self.overflowed = self.used = self.posed = self.unposed = 0
        self.refused: Counter[str] = Counter()

    @property
    def restarts(self) -> int:
        """Times that the sender went on in another world."""
        return self._poses.restarts

    def place(self, frame: Frame) -> Frame:
        """The frame with T_world_sensor at its stamp, None where the poses received are too old."""
        try:
            for message in self._take():
                try:
                    self._keep(*self._read(message), frame.stamp_s)
                except Exception as error:
                    self._refuse(error)
            T = self._poses.believed.at(frame.stamp_s)
        except Exception as error:  # poses are optional: the run goes on without
            T = None
            self._refuse(error)
        self.posed, self.unposed = self.posed + (T is not None), self.unposed + (T is None)
        return replace(frame, T_world_sensor=T, restarts=self.restarts)

    def report(self) -> dict[str, Any]:
        """Counts of messages, of those that the system dropped, of restarts, of frames with and without a pose."""
        return {
            "source": self.name,
            "received": self.received,
            "overflowed": self.overflowed,
            "used": self.used,
            "refused": {reason: self.refused[reason] for reason in self.REASONS},
            "restarts": self.restarts,
            "frames_posed": self.posed,
            "frames_unposed": self.unposed,
        }

    def _take(self) -> Sequence[Any]:
        """The messages that have arrived, without waiting."""
        raise NotImplementedError

    def _read(self, message: Any, /) -> tuple[float, Float64]:
        """Stamp [s] and (4, 4) T_world_sensor of a message; raises DatagramError."""
        raise NotImplementedError

    def _keep(self, stamp_s: float, T: Float64, now_s: float) -> None:
        cause = f"stamp {stamp_s:.15g} s when the frame's is {now_s:.15g} s"
        if stamp_s and now_s and abs(stamp_s - now_s) > MAX_AHEAD_S:
            for whose, ratio in (("this one seems", stamp_s / now_s), ("the sensor's seem", now_s / stamp_s)):
                if unit := unit_of(ratio):
                    raise DatagramError("unit", f"{cause}: {whose} to be in {unit}; give seconds")
        if abs(stamp_s) > MAX_STAMP_S:
            raise DatagramError("malformed", f"{cause}: no time in seconds")
        if stamp_s > now_s + MAX_AHEAD_S:
            raise DatagramError("ahead", f"{cause}: is it the stream's clock?")
        newest_s, restarts = self._poses.believed.newest_s, self.restarts
        doubt = self._poses.add(stamp_s, T, now_s)
        if self.restarts > restarts == 0:
            where = f"another place than the sensor can have reached, at stamp {stamp_s:.3f} s"
            meaning = "the sender seems to have restarted, tracks keep their positions"
            remedy = "let it keep its origin, or raise odometry.max_speed_mps for a faster robot"
            log.warning("%s: %s: %s; %s; later ones are only counted", self.name, where, meaning, remedy)
        if stamp_s < now_s - MAX_AGE_S:
            raise DatagramError("stale", cause)
        if doubt is not None:
            raise DatagramError(doubt, f"stamp {stamp_s:.3f} s after {newest_s:.3f} s")
        self.used += 1

    def _refuse(self, error: Exception, number: int = 1) -> None:
        if not isinstance(error, DatagramError):
            self._poses.clear()  # which may be the cause
            remedy = "frames have no pose until it works; check the sender and its network, or report this line"
            error = DatagramError("failed", f"{type(error).__name__}: {error}; {remedy}")
        self.refused[error.reason] += number
        if self.refused[error.reason] == number:
            log.warning("%s: pose refused (%s): %s; later ones are only counted", self.name, error.reason, error)
