"""Configuration of the fusion and of the decision."""

from __future__ import annotations

from dataclasses import dataclass

from modt.classes import CLASSES
from modt.config.fields import StageConfig, choice, number, per_class


@dataclass(frozen=True, kw_only=True)
class FusionConfig(StageConfig):
    """Fusion of views, boxes and motion to a class, and its confirmation (section V-C, Figs. 10 and 11)."""

    rule: str = choice(
        "mean",
        ("mean", "product"),
        "How the views of a track are combined. mean: averaged. product: multiplied, Equation 6 of the paper.",
    )
    object_threshold: float = number(0.9, 0.25, 1.0, "", "Posterior from which the class of an object is confirmed.")
    min_object_probability: float = number(
        0.1, 0.0, 1.0, "", "Tracks less likely an object by box and motion are not classified."
    )
    start_frame: int = number(
        4, 1, 1000, "frames", "Age of a track from which its views are combined, with rule product."
    )
    point_change: tuple[float, ...] = per_class(
        "point_change",
        0.0,
        10.0,
        "Relative change of the number of points (Equation 4) from which a view is independent, with rule product.",
        range(len(CLASSES)),
    )


@dataclass(frozen=True, kw_only=True)
class DecisionConfig(StageConfig):
    """The reported class of a track."""

    rule: str = choice(
        "adapted",
        ("adapted", "likeliest"),
        "How the class is chosen. adapted: posteriors are adapted to the class frequency of the stream, and a class "
        "is kept down to a posterior of 0.4. likeliest: the likeliest object, from its threshold on.",
    )
    missed_cost: tuple[float, ...] = per_class(
        "missed_cost",
        0.01,
        1000.0,
        "Cost of a missed object, relative to a false one. Objects are reported from a posterior of 1 / (1 + cost).",
    )
    frequency: tuple[float, ...] | None = per_class(
        None,
        0.0001,
        0.33,
        "Share of each class among the proposals at the start of a run. Null: as the model assumes.",
    )
