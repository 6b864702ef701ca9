"""Limits of the classification of a frame."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Budget:
    """Limits of one frame's classification. None means no limit."""

    calls: int | None = None  # proposals classified
    cpu_ms: float | None = None  # CPU time by the cost model [ms]
    mean_ms: float | None = None  # CPU time on average; what is not spent is carried over, for a second at most [ms]


UNLIMITED = Budget()
