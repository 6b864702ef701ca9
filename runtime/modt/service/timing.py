"""Punctuality of the loop: every frame against its deadline, and the time that is left for classification."""

from __future__ import annotations

from typing import Any

from modt.pipeline import CLASSIFICATION
from modt.reporting.log_histogram import LogHistogram

DECAY = 0.95
"""Weight of the past a frame, in the cost of the other stages; a greater cost counts at once."""


class Timing:
    """Lateness (start less release), execution, and latency (result less release) of frames.

    A sweep is released when it is complete; its deadline is a period later.
    """

    def __init__(self) -> None:
        self.lateness, self.execution, self.latency = LogHistogram(), LogHistogram(), LogHistogram()
        self.missed = 0

    def add(self, release_s: float, start_s: float, finish_s: float, period_s: float) -> float:
        """Add a frame; returns its latency in periods, beyond 1 when it missed its deadline."""
        self.lateness.add(start_s - release_s)
        self.execution.add(finish_s - start_s)
        self.latency.add(finish_s - release_s)
        share = (finish_s - release_s) / period_s
        self.missed += share > 1.0
        return share

    def report(self) -> dict[str, Any]:
        """Figures for status and summary [ms]."""
        return {
            "frames": self.latency.count,
            "missed_deadlines": self.missed,
            "lateness_ms": self.lateness.figures_ms(),
            "execution_ms": self.execution.figures_ms(),
            "latency_ms": self.latency.figures_ms(),
        }


class RestCost:
    """What a frame costs beside its classification: a maximum over the last frames that decays."""

    def __init__(self) -> None:
        self.ms = 0.0

    def add(self, ledger_line: dict[str, Any]) -> None:
        """Add the ledger line of a frame."""
        stages = ledger_line["stages"].items()
        ms = 1e-6 * sum(row["wall_ns"] for stage, row in stages if stage != CLASSIFICATION)
        self.ms = max(ms, DECAY * self.ms + (1 - DECAY) * ms)
