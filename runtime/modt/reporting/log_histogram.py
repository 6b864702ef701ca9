"""Quantiles of times in a fixed number of counts."""

from __future__ import annotations

import math

import numpy as np

LEAST_S, OCTAVES, PER_OCTAVE = 1e-6, 30, 8
"""Bins from a microsecond to 18 minutes, each 9 % wider than the one before."""


class LogHistogram:
    """Count, sum, maximum and quantiles (within 5 %) of times; negative ones count as 0."""

    def __init__(self) -> None:
        self.count, self.total_s, self.maximum_s = 0, 0.0, 0.0
        self._counts = np.zeros(OCTAVES * PER_OCTAVE, np.int64)

    def add(self, seconds: float) -> None:
        """Add one time."""
        seconds = max(seconds, 0.0)
        self.count += 1
        self.total_s += seconds
        self.maximum_s = max(self.maximum_s, seconds)
        place = PER_OCTAVE * math.log2(max(seconds, LEAST_S) / LEAST_S)
        self._counts[min(int(place), len(self._counts) - 1)] += 1

    def quantile_s(self, share: float) -> float:
        """Quantile at that share; 0 without times."""
        if not self.count:
            return 0.0
        place = int(np.searchsorted(np.cumsum(self._counts), share * self.count))
        middle_s: float = LEAST_S * 2 ** ((place + 0.5) / PER_OCTAVE)
        return min(middle_s, self.maximum_s)

    def figures_ms(self) -> dict[str, float]:
        """Mean, quantiles and maximum [ms]."""
        times_s = {
            "mean": self.total_s / max(self.count, 1),
            "p50": self.quantile_s(0.5),
            "p99": self.quantile_s(0.99),
            "max": self.maximum_s,
        }
        return {name: round(1e3 * seconds, 3) for name, seconds in times_s.items()}

    def beyond(self) -> dict[str, list[float]]:
        """Lower edges of the bins in use [ms], and how many times are that long or longer."""
        used = np.flatnonzero(self._counts)
        bins = np.arange(used[0], used[-1] + 1) if len(used) else used
        edges_ms = 1e3 * LEAST_S * 2 ** (bins / PER_OCTAVE)
        frames = np.cumsum(self._counts[::-1])[::-1][bins]
        return {"ms": edges_ms.round(4).tolist(), "frames": frames.tolist()}
