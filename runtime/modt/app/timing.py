"""Punctuality of the loop: every frame against its deadline."""

from __future__ import annotations

from typing import Any

import numpy as np

from modt.reporting.histogram import Histogram

_BITS = 5
"""Leading bits held of a time [ns]: an error below 3 %, in at most 960 counts."""


class Timing:
    """Lateness (start less release), execution, and latency (result less release) of frames.

    A sweep is released when it is complete; its deadline is a period later.
    """

    def __init__(self) -> None:
        self.lateness, self.execution, self.latency = (Histogram(_BITS) for _ in range(3))
        self.missed = 0

    def add(self, release_s: float, start_s: float, finish_s: float, period_s: float) -> float:
        """Add a frame; returns its latency in periods, beyond 1 when it missed its deadline."""
        self.lateness.add(round(1e9 * (start_s - release_s)))
        self.execution.add(round(1e9 * (finish_s - start_s)))
        self.latency.add(round(1e9 * (finish_s - release_s)))
        share = (finish_s - release_s) / period_s
        self.missed += share > 1.0
        return share

    def report(self) -> dict[str, Any]:
        """Figures for status and summary [ms]."""
        return {
            "frames": self.latency.count,
            "missed_deadlines": self.missed,
            "lateness_ms": _figures_ms(self.lateness),
            "execution_ms": _figures_ms(self.execution),
            "latency_ms": _figures_ms(self.latency),
        }

    def late_or_later(self) -> dict[str, list[float]]:
        """Lateness that occurred [ms], and the number of frames that were as late or later."""
        held = self.lateness.occurrences()
        ms = (1e-6 * np.array(held["values"])).round(4).tolist()
        return {"ms": ms, "frames": np.cumsum(held["counts"][::-1])[::-1].tolist()}


def _figures_ms(times_ns: Histogram) -> dict[str, float]:
    return {name: round(ms, 3) for name, ms in times_ns.figures(1e6, p50=0.5, p99=0.99).items()}
