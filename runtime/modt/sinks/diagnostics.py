"""The trust of a frame as diagnostics of ROS 2."""

from __future__ import annotations

from modt.ros2.cdr import CdrWriter
from modt.types import FrameResult

TYPE = "diagnostic_msgs/DiagnosticArray"


def diagnostics(result: FrameResult, frame_id: str) -> bytes:
    """diagnostic_msgs/DiagnosticArray: the trust as OK, WARN (degraded) or ERROR (blind), a value for each reason."""
    trust = result.trust
    cdr = CdrWriter()
    cdr.header(result.frame.stamp_s, frame_id)
    cdr.record(("I", "B"), 1, trust.level.value)
    for text in ("modt: trust", trust.reasons[0].cause if trust.reasons else trust.word, frame_id):
        cdr.text(text)
    values = {"trust": trust.word, "since_s": f"{trust.since_s:.3f}", **{r.key: r.cause for r in trust.reasons}}
    cdr.record(("I",), len(values))
    for key, value in values.items():
        cdr.text(key)
        cdr.text(value)
    return cdr.message()
