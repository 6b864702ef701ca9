"""Tracking of proposals (sections III-B and IV-A)."""

from __future__ import annotations

from dataclasses import dataclass

from modt.config.base import StageConfig, choice, mechanism, number


@dataclass(frozen=True, slots=True, kw_only=True)
class PaperAssociationConfig(StageConfig):
    """The paper's association cost (section III-B); in effect with association: paper."""

    alpha: float = number(2.0, 0.0, 100.0, "", "weight of 1 - IoU, seen from above")
    beta: float = number(0.01, 0.0, 10.0, "", "reward of like numbers of points")
    gamma: float = number(0.1, 0.0, 10.0, "", "reward of like sizes")
    t_da: float = number(0.95, 0.0, 100.0, "", "highest cost of an association")


@dataclass(frozen=True, slots=True, kw_only=True)
class TrackingConfig(StageConfig):
    """Association and life of a track. Limits of a mechanism are constants beside it."""

    association: str = choice("kdop", ("kdop", "paper"), "cost by which proposals are matched with tracks")
    extensions: str = choice(
        "all",
        ("all", "none"),
        "beside the paper: tracks split, merge and reunite proposals, may stand still, and background is remembered",
    )
    max_missed: int = number(
        8, 0, 100, "frames", "of sensor.period_s, unseen, before a track is deleted (N of a9 and a14)"
    )
    paper: PaperAssociationConfig = mechanism(PaperAssociationConfig)
