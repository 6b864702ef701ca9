"""Poses received from another process, and rejection of wrong ones.

Stamps of poses and frames are on the clock of the stream, `stamp_s` of `tracks.jsonl`. No other clock is read, so a
replay is reproducible if it receives the same poses before the same frames.
"""

from __future__ import annotations

import logging
from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from modt.config import OdometryConfig
from modt.poses.pose_source import PoseSource
from modt.ros2.cdr import MessageError
from modt.sources.pose_buffer import MAX_AGE_S, PoseBuffer
from modt.sources.pose_file import pose_defect
from modt.sources.stream import MAX_STAMP_S, unit_of
from modt.types import Float64, Frame

log = logging.getLogger(__name__)

CONFIRM_S = 0.2
"""Time for which doubted poses must be mutually consistent to be accepted [s]."""
_MIN_VOTES = 5
"""Number of votes after which a doubted sequence replaces the old one."""


class PoseSequence:
    """Poses that are mutually consistent; single inconsistent ones are doubted.

    Mutually consistent doubted poses form a sequence of their own. A pose that continues it votes for it, any other
    pose votes against it. After _MIN_VOTES votes over CONFIRM_S the new sequence replaces the old one: the sender has
    set its clock or, after a leap, restarted with another world.

    Attributes:
        accepted: poses of the current sequence.
        restarts: number of sequences that took over with a leap.
    """

    def __init__(self, config: OdometryConfig) -> None:
        self.config = config
        self.restarts = 0
        self.clear()

    def clear(self) -> None:
        """Remove all poses; the next one is accepted."""
        self.accepted = PoseBuffer(self.config)
        self._doubted = PoseBuffer(self.config)
        self._votes = 0

    def add(self, stamp_s: float, T: Float64, now_s: float) -> str | None:
        """Add a (4, 4) pose received before the frame at `now_s`; the reason of a doubt, None if it is accepted."""
        doubt = self.accepted.doubt(stamp_s, T, now_s)
        if doubt is None:
            self.accepted.add(stamp_s, T)
            self._vote_against()
        elif doubt != "repeated":
            self._consider(stamp_s, T, now_s)
            if self._votes >= _MIN_VOTES and self._doubted.span_s >= CONFIRM_S:
                self.restarts += self.accepted.leaps(stamp_s, T)
                self.accepted = self._doubted
                self._doubted = PoseBuffer(self.config)
                self._votes = 0
                return None
        return doubt

    def _consider(self, stamp_s: float, T: Float64, now_s: float) -> None:
        doubt = self._doubted.doubt(stamp_s, T, now_s)
        if doubt not in (None, "repeated"):
            self._vote_against()
            # That vote may have ended the doubted sequence; then this pose begins the next one.
            doubt = self._doubted.doubt(stamp_s, T, now_s)
        if doubt is None:
            self._doubted.add(stamp_s, T)
            self._votes += 1

    def _vote_against(self) -> None:
        self._votes = max(0, self._votes - 1)
        if not self._votes:
            self._doubted = PoseBuffer(self.config)


MAX_AHEAD_S = 60.0
"""Greatest lead of a pose over its frame [s]; a pose beyond it is stamped by another clock."""


class ReceivedPoses(PoseSource):
    """Poses that another process sends; refused ones are counted, and the first of each kind is logged.

    `PoseSequence` decides which poses are accepted. `Frame.restarts` reports a sender that restarted with another
    world frame. A subclass takes the messages and reads them.
    """

    has_poses = True  # single frames may have none
    REASONS = (
        *("malformed", "non_finite", "unit", "crowded_out", "stale", "ahead", "failed"),
        *("repeated", "out_of_order", "early", "leap"),  # doubts of PoseBuffer
    )
    """Reasons of a refusal; each has a counter."""

    def __init__(self, config: OdometryConfig, name: str) -> None:
        self.name = name
        self._poses = PoseSequence(config)
        # Messages, and those of them that the kernel dropped, that were used, and that were refused by reason
        self.received = 0
        self.overflowed = 0
        self.used = 0
        self.refused: Counter[str] = Counter()
        # Frames with a pose, and without one
        self.posed = 0
        self.unposed = 0

    @property
    def restarts(self) -> int:
        """Number of times that the sender continued in another world."""
        return self._poses.restarts

    def place(self, frame: Frame) -> Frame:
        """Return the frame with T_world_sensor at its stamp, None where the received poses are too old."""
        try:
            for message in self._take():
                try:
                    self._keep(*self._read(message), frame.stamp_s)
                except Exception as error:
                    self._refuse(error)
            placed = self._poses.accepted.placed(frame)
        except Exception as error:  # poses are optional, so the run goes on without
            placed = replace(frame, T_world_sensor=None)
            self._refuse(error)
        if placed.T_world_sensor is None:
            self.unposed += 1
        else:
            self.posed += 1
        return replace(placed, restarts=self.restarts)

    def report(self) -> dict[str, Any]:
        """Counts of received, dropped, used and refused messages, of restarts, of frames with and without a pose."""
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
        """Take the messages that have arrived, without waiting."""
        raise NotImplementedError

    def _read(self, message: Any, /) -> tuple[float, Float64]:
        """Stamp [s] and (4, 4) T_world_sensor of a message; MessageError if it has none."""
        raise NotImplementedError

    def _keep(self, stamp_s: float, T: Float64, now_s: float) -> None:
        if defect := pose_defect(T):
            raise MessageError("malformed", f"pose is {defect}")
        cause = f"stamp {stamp_s:.15g} s when the frame's is {now_s:.15g} s"
        if now_s and abs(stamp_s - now_s) > MAX_AHEAD_S and (unit := unit_of(stamp_s / now_s)):
            raise MessageError("unit", f"{cause}: it seems to be in {unit}; give seconds")
        if abs(stamp_s) > MAX_STAMP_S:
            raise MessageError("malformed", f"{cause}: no time in seconds")
        if stamp_s > now_s + MAX_AHEAD_S:
            raise MessageError("ahead", f"{cause}: is it the stream's clock?")
        newest_s = self._poses.accepted.newest_s
        restarts = self.restarts
        doubt = self._poses.add(stamp_s, T, now_s)
        if self.restarts > restarts == 0:
            where = f"another place than the sensor can have reached, at stamp {stamp_s:.3f} s"
            meaning = "the sender seems to have restarted, tracks keep their positions"
            remedy = "let it keep its origin, or raise odometry.max_speed_mps for a faster robot"
            log.warning("%s: %s: %s; %s; later ones are only counted", self.name, where, meaning, remedy)
        if stamp_s < now_s - MAX_AGE_S:
            raise MessageError("stale", cause)
        if doubt is not None:
            raise MessageError(doubt, f"stamp {stamp_s:.3f} s after {newest_s:.3f} s")
        self.used += 1

    def _refuse(self, error: Exception, number: int = 1) -> None:
        if not isinstance(error, MessageError):
            self._poses.clear()  # they may be the cause
            remedy = "frames have no pose until it works; check the sender and its network, or report this line"
            error = MessageError("failed", f"{type(error).__name__}: {error}; {remedy}")
        self.refused[error.reason] += number
        if self.refused[error.reason] == number:
            log.warning("%s: pose refused (%s): %s; later ones are only counted", self.name, error.reason, error)
