"""The live loop under load, and what it records."""

from __future__ import annotations

from dataclasses import dataclass

from modt.config.base import StageConfig, choice, number


@dataclass(frozen=True, slots=True, kw_only=True)
class LoopConfig(StageConfig):
    """What the loop keeps to, and what it gives up for it."""

    range_share: float = number(0.6, 0.05, 1.0, "", "of sensor.max_range_m that is kept where the range is reduced")
    power_W: float | None = number(None, 0.01, 1000.0, "W", "limit, by the meter or the board's model; null: none")


@dataclass(frozen=True, slots=True, kw_only=True)
class RecordingConfig(StageConfig):
    """Records of the live loop."""

    keep: str = choice("all", ("all", "tracks", "ledger", "none"), "which records are written")
    disk_mb: float = number(
        2000.0, 1.0, 1e7, "MB", "of the records of this run and earlier ones; the oldest are deleted"
    )
