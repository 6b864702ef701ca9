"""Tracking of proposals (sections III-B and IV-A)."""

from __future__ import annotations

from dataclasses import dataclass

from modt.config.base import StageConfig, choice, mechanism, number


@dataclass(frozen=True, slots=True, kw_only=True)
class PaperAssociationConfig(StageConfig):
    """Association cost of the paper (section III-B), in effect with `association: paper`."""

    alpha: float = number(2.0, 0.0, 100.0, "", "Weight of 1 - IoU of the boxes seen from above.")
    beta: float = number(0.01, 0.0, 10.0, "", "Weight of similar numbers of points, which lower the cost.")
    gamma: float = number(0.1, 0.0, 10.0, "", "Weight of similar sizes, which lower the cost.")
    t_da: float = number(0.95, 0.0, 100.0, "", "Greatest cost of a match.")


@dataclass(frozen=True, slots=True, kw_only=True)
class TrackingConfig(StageConfig):
    """Association of proposals with tracks, and the end of a track."""

    association: str = choice("kdop", ("kdop", "paper"), "Cost of a match: by outlines (kdop), or as in the paper.")
    extensions: str = choice(
        "all",
        ("all", "none"),
        "Additions to the paper: tracks split, merge and reunite proposals, can be at rest, and leave remembered "
        "background. none: switched off.",
    )
    max_missed: int = number(
        8, 0, 100, "frames", "Time without a proposal, in periods, after which a track is deleted (N of a9 and a14)."
    )
    paper: PaperAssociationConfig = mechanism(PaperAssociationConfig)
