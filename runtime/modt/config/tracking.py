"""Configuration of the tracking."""

from __future__ import annotations

from dataclasses import dataclass

from modt.config.fields import StageConfig, choice, number


@dataclass(frozen=True, kw_only=True)
class TrackingConfig(StageConfig):
    """Association of proposals with tracks, and the end of a track."""

    association: str = choice("kdop", ("kdop", "paper"), "Cost of a match: by outlines (kdop), or as in the paper.")
    extensions: str = choice(
        "all",
        ("all", "none"),
        "Additions to the paper: tracks split, merge and reunite proposals, and can be at rest. none: switched off.",
    )
    max_missed: int = number(
        8, 0, 100, "frames", "Time without a proposal, in periods, after which a track is deleted (N of a9 and a14)."
    )
