"""Configuration of the live loop, of its results and of its records."""

from __future__ import annotations

from dataclasses import dataclass

from modt.config.fields import StageConfig, choice, number


@dataclass(frozen=True, kw_only=True)
class LoopConfig(StageConfig):
    """Limit of the live loop, in effect with `modt run`."""

    power_W: float | None = number(
        None,
        0.01,
        1000.0,
        "W",
        "Power of the board, with its idle power, above which the loop sheds load. Null: no limit.",
    )


@dataclass(frozen=True, kw_only=True)
class TrustConfig(StageConfig):
    """Results while modt is blind, that is while what it reports does not follow from what is around."""

    results: str = choice(
        "always",
        ("always", "unless_blind"),
        "What sinks get. always: every result, with its trust. unless_blind: none while the trust is blind; "
        "the records go on.",
    )


@dataclass(frozen=True, kw_only=True)
class RecordingConfig(StageConfig):
    """Records of the live loop, in effect with `modt run`."""

    keep: str = choice(
        "all", ("all", "tracks", "ledger", "none"), "Records that are written: tracks, ledger, both or none."
    )
    disk_mb: float = number(2000.0, 1.0, 1e7, "MB", "Size of all records together. The oldest are deleted.")
    gb_per_day: float = number(
        10.0, 0.01, 1e5, "GB", "Size of the tracks of a day, after the first 0.5 GB. Frames beyond it are left out."
    )
