"""Classification, its budget, and fusion."""

from __future__ import annotations

from dataclasses import dataclass, field

from modt.classes import CLASSES
from modt.config.base import StageConfig, choice, number, per_class, shares

BATCH = 4
"""Proposals of one network call: few enough for their features to stay in the cache."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ClassificationConfig(StageConfig):
    """The network and its input (section V-A)."""

    model: str = field(default="pointnet-kitti", metadata={"meaning": "name in models/ or path of an .onnx file"})
    likelihood: str = choice(
        "pooled",
        ("pooled", "network"),
        "pooled: the network with the classifiers of box and reflectance, on a proposal's own points; "
        "network: as in the paper the network alone, on max_points points, one proposal a call",
    )
    max_points: int = number(
        128, 8, 4096, "", "points of a proposal handed to the network; of more an even subsample"
    )

    @property
    def batch(self) -> int:
        """Proposals of one network call at most."""
        return BATCH if self.likelihood == "pooled" else 1

    @property
    def min_points(self) -> int:
        """Points of a proposal to which it is repeated, which costs more and changes no class."""
        return 1 if self.likelihood == "pooled" else self.max_points


@dataclass(frozen=True, slots=True, kw_only=True)
class SchedulerConfig(StageConfig):
    """Budget of classification per frame; none: unlimited."""

    calls_per_frame: int | None = number(16, 0, 10000, "", "proposals classified in a frame")
    cpu_ms_per_frame: float | None = number(
        None, 0.0, 10000.0, "ms", "CPU time of classification a frame, on average over a second"
    )
    energy_mJ_per_frame: float | None = number(
        None, 0.0, 100000.0, "mJ", "energy of classification a frame above idle, on average over a second"
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class DecisionConfig(StageConfig):
    """The class that is reported of a track."""

    rule: str = choice(
        "adapted",
        ("adapted", "likeliest"),
        "adapted: the class frequency of the stream counts, and a reported class is kept down to a share of its "
        "threshold; likeliest: neither",
    )
    missed_cost: tuple[float, ...] = per_class(
        "missed_cost",
        0.01,
        1000.0,
        "cost of a missed object over that of a false one; reported from a probability of 1 / (1 + cost) on",
    )
    frequency: tuple[float, ...] | None = shares(
        0.33, "frequency of the classes among proposals at the start; null: the one that the model assumes"
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class FusionConfig(StageConfig):
    """Views, boxes and motion fused to a class, and final classes (section V-C, Figs. 10 and 11)."""

    rule: str = choice("mean", ("mean", "product"), "how views are fused; product: Equation 6 of the paper")
    object_threshold: float = number(0.9, 0.25, 1.0, "", "probability at which the class of an object is final")
    min_object_probability: float = number(
        0.1, 0.0, 1.0, "", "a track is classified from this probability of an object on, by its box and motion"
    )
    start_frame: int = number(4, 1, 1000, "frames", "age of a track from which views are multiplied")
    point_change: tuple[float, ...] = per_class(
        "point_change",
        0.0,
        10.0,
        "relative change of points (Equation 4) from which a view is independent",
        tuple(CLASSES),
    )
