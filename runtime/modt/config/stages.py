"""Configuration of the stages. Limits of a mechanism are constants beside it.

Defaults of the segmentation without another source were chosen on KITTI object frames and labelled odometry scans,
and checked on drive 0005 and on simulated streets (docs/evaluation.md).
"""

from __future__ import annotations

from dataclasses import dataclass, field

from modt.classes import CLASSES
from modt.config.base import StageConfig, choice, number, per_class, shares

BATCH = 4
"""Proposals of one network call: few enough for their features to stay in the cache."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ClassificationConfig(StageConfig):
    """The network and its input (section V-A)."""

    model: str = field(
        default="pointnet-kitti", metadata={"meaning": "Name of a model in models/, or path of an .onnx file."}
    )
    likelihood: str = choice(
        "pooled",
        ("pooled", "network"),
        "How likely a view is for each class. pooled: by the network together with the classifiers of box and "
        "reflectance, on the proposal's own points. network: as in the paper by the network alone, on exactly "
        "max_points points, one proposal a call.",
    )
    max_points: int = number(128, 8, 4096, "", "Greatest number of points of a proposal that the network sees.")

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
    """Budget of classification. Null means no limit, and the limit that is reached first applies."""

    calls_per_frame: int | None = number(16, 0, 10000, "", "Greatest number of proposals classified in a frame.")
    cpu_ms_per_frame: float | None = number(
        None, 0.0, 10000.0, "ms", "CPU time of classification in a frame, on average over a second."
    )
    energy_mJ_per_frame: float | None = number(
        None, 0.0, 100000.0, "mJ", "Energy of classification in a frame above idling, on average over a second."
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class DecisionConfig(StageConfig):
    """The reported class of a track."""

    rule: str = choice(
        "adapted",
        ("adapted", "likeliest"),
        "How the class is chosen. adapted: posteriors are adapted to the class frequency of the stream, and a "
        "reported class is kept down to a fraction of its threshold. likeliest: the class of the greatest posterior.",
    )
    missed_cost: tuple[float, ...] = per_class(
        "missed_cost",
        0.01,
        1000.0,
        "Cost of a missed object, relative to a false one. Objects are reported from a posterior of 1 / (1 + cost).",
    )
    frequency: tuple[float, ...] | None = shares(
        0.33, "Share of each class among the proposals at the start of a run. Null: as the model assumes."
    )


@dataclass(frozen=True, slots=True, kw_only=True)
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
        tuple(CLASSES),
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class OdometryConfig(StageConfig):
    """Poses from another program, in effect with `--odometry udp://`, `unix://` and `ros2://`."""

    max_speed_mps: float = number(
        60.0, 0.1, 1000.0, "m/s", "Greatest speed of the sensor. A faster jump means a restarted sender."
    )


KERNELS = AUTO, NATIVE, NUMPY = "auto", "native", "numpy"


@dataclass(frozen=True, slots=True, kw_only=True)
class SegmentationConfig(StageConfig):
    """Ground, clusters, and the sizes that an object can have (section III-A)."""

    max_slope_deg: float = number(16.0, 0.5, 45.0, "deg", "Steepest slope of the ground, up or down.")
    clearance_m: float = number(0.25, 0.02, 1.0, "m", "Height above the ground from which points belong to objects.")
    max_height_m: float = number(2.6, 0.3, 20.0, "m", "Height above the ground up to which points belong to objects.")
    cell_m: float = number(
        0.105, 0.01, 2.0, "m", "Side of a cell at 10 m. It grows with the square root of the range."
    )
    min_points: int = number(5, 1, 1000, "", "Least number of points of a proposal.")
    max_extent_m: float = number(9.0, 0.5, 50.0, "m", "Greatest length of a proposal.")
    min_height_m: float = number(0.2, 0.0, 3.0, "m", "Least height of a proposal.")
    kernels: str = choice(
        "auto",
        KERNELS,
        "Code for points: compiled (native), NumPy (numpy), or compiled where it can be (auto). "
        "The environment variable MODT_KERNELS overrules this key.",
    )


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
