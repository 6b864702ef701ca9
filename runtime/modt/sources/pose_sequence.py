"""Which of the poses received are believed."""

from __future__ import annotations

from modt.config import OdometryConfig
from modt.sources.pose_buffer import PoseBuffer
from modt.types import Float64

_MIN_VOTES = 5


class PoseSequence:
    """Poses that continue one another; single ones that do not are doubted.

    Doubted poses that continue one another instead are a sequence of their own. Poses vote: one that continues the
    doubted sequence for it, any other against. From a number of votes and a span of time on it is the one believed:
    the sender has another clock or, after a leap, has restarted with another world.

    Attributes:
        believed: poses of the sequence that is believed.
        restarts: sequences that took over with a leap.
    """

    def __init__(self, config: OdometryConfig) -> None:
        self.config = config
        self.believed, self._doubted, self._votes = PoseBuffer(config), PoseBuffer(config), 0
        self.restarts = 0

    def add(self, stamp_s: float, T: Float64, now_s: float) -> str | None:
        """Take in a (4, 4) pose, received before a frame of time now_s; why it is doubted, None if it is believed."""
        doubt = self.believed.doubt(stamp_s, T, now_s)
        if doubt is None:
            self.believed.add(stamp_s, T)
            self._vote_against()
        elif doubt != "repeated":
            self._consider(stamp_s, T, now_s)
            if self._votes >= _MIN_VOTES and self._doubted.span_s >= self.config.confirm_s:
                self.restarts += self.believed.leaps(stamp_s, T)
                self.believed, self._doubted, self._votes = self._doubted, PoseBuffer(self.config), 0
                return None
        return doubt

    def _consider(self, stamp_s: float, T: Float64, now_s: float) -> None:
        doubt = self._doubted.doubt(stamp_s, T, now_s)
        if doubt not in (None, "repeated"):
            self._vote_against()
            doubt = self._doubted.doubt(stamp_s, T, now_s)
        if doubt is None:
            self._doubted.add(stamp_s, T)
            self._votes += 1

    def _vote_against(self) -> None:
        self._votes = max(0, self._votes - 1)
        if not self._votes:
            self._doubted.clear()
