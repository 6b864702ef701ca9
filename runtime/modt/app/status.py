"""The status of a service: one JSON document, made once a second."""

from __future__ import annotations

from typing import Any

import numpy as np

from modt.app.live_loop import LiveLoop
from modt.classes import CLASS_NAMES
from modt.types import NONE, FrameResult

SCHEMA = "modt.status/1"
MIN_RATE_S = 0.5
"""Shortest time over which a rate is formed."""
STALE_S = 5.0
"""Age from which a status is no longer that of a running service."""


class Counts:
    """Frames and tracks since the start, and their rate."""

    def __init__(self, now_s: float) -> None:
        self.classifications = self.deferred = self.proposals = 0
        self.classes = dict.fromkeys(CLASS_NAMES, 0)
        self.tracks = 0
        self.rate_hz = 0.0
        self._frames = self._last_frames = 0
        self._last_s = now_s

    def add(self, result: FrameResult) -> None:
        """Add a frame."""
        self._frames += 1
        self.proposals += len(result.proposals)
        self.classifications += len(result.classified)
        self.deferred += result.n_deferred
        self.tracks = len(result.tracks)
        seen = result.tracks.object_class[result.tracks.proposal != NONE]
        self.classes = dict(zip(CLASS_NAMES, np.bincount(seen, minlength=len(CLASS_NAMES)).tolist(), strict=True))

    def report(self, now_s: float) -> dict[str, Any]:
        """Figures for the status; the rate is that of the time between reports."""
        frames, seconds = self._frames - self._last_frames, now_s - self._last_s
        if seconds >= MIN_RATE_S:
            self.rate_hz = frames / seconds
            self._last_frames, self._last_s = self._frames, now_s
        return {
            "frames": self._frames,
            "rate_hz": round(self.rate_hz, 2),
            "tracks": self.tracks,
            "visible": self.classes,
            "proposals": self.proposals,
            "classifications": self.classifications,
            "deferred": self.deferred,
        }


def loop_report(loop: LiveLoop) -> dict[str, Any]:
    """What the loop knows of itself."""
    return {
        **loop.timing.report(),
        "budget_ms": round(loop.budget_ms, 3),
        "other_stages_ms": round(loop.rest.ms, 3),
        "step": loop.ladder.step.name.lower(),
        "steps_entered": dict(loop.changes),
        "shed_sweeps": loop.shed,
        "failures": dict(loop.failures.counts),
        "reloads": loop.reloads,
        "refused_reloads": loop.refused_reloads,
    }


def one_line(status: dict[str, Any]) -> str:
    """Rate, tracks and watts, as systemd shows them."""
    counts, loop, power = status["counts"], status["loop"], status["power"]
    classes = ", ".join(f"{n} {name}" for name, n in counts["visible"].items() if n and name != CLASS_NAMES[0])
    watts = "power unknown" if power["watts"] is None else f"{power['watts']:.1f} W {power['kind']}"
    step = "" if loop["step"] == "all" else f", load: {loop['step']}"
    silent = ", sensor silent" if status["sensor"].get("silent") else ""
    seen = f" ({classes})" if classes else ""
    return f"{counts['rate_hz']:.1f} Hz, {counts['tracks']} tracks{seen}, {watts}{step}{silent}"
