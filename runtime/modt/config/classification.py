"""Classification, its budget, and fusion."""

from __future__ import annotations

from dataclasses import dataclass, field

from modt.config.base import StageConfig, number, per_class


@dataclass(frozen=True, slots=True, kw_only=True)
class ClassificationConfig(StageConfig):
    """The network and how its input is made (section V-A)."""

    model: str = field(default="pointnet-kitti", metadata={"meaning": "name in models/ or path of an .onnx file"})
    max_points: int = number(128, 8, 4096, "", "of a proposal handed to the network")
    batch: int = number(8, 1, 256, "", "proposals of one network call at most")


@dataclass(frozen=True, slots=True, kw_only=True)
class SchedulerConfig(StageConfig):
    """What one frame may spend on classification; none: no bound."""

    calls_per_frame: int | None = number(16, 0, 10000, "", "proposals classified")
    cpu_ms_per_frame: float | None = number(None, 0.0, 10000.0, "ms", "CPU time by the measured cost model")
    energy_mJ_per_frame: float | None = number(None, 0.0, 100000.0, "mJ", "drawn beyond idle during that time")


@dataclass(frozen=True, slots=True, kw_only=True)
class FusionConfig(StageConfig):
    """Which views are independent, and when a class is settled (section V-C, Figs. 10 and 11)."""

    threshold: float = number(0.9, 0.25, 1.0, "", "posterior at which an object's class is fixed")
    background_threshold: float = number(0.6, 0.25, 1.0, "", "that of background, were all classes as common")
    view_weight: float = number(1.0, 0.0, 1.0, "", "share of a further view's evidence; 1: as if independent")
    alpha: tuple[float, ...] = per_class(
        "point_change", 0.0, 10.0, "relative change of points of an independent view"
    )
    background_alpha: float = number(0.5, 0.0, 10.0, "", "the same, of what looks like background")
    prior: tuple[float, ...] = per_class("prior", 0.0, 0.33, "frequency among proposals")
    likely: float = number(0.01, 0.0, 1.0, "", "probability of an object, by its box, from which it is classified")
    likely_once: float = number(0.1, 0.0, 1.0, "", "the same where the first view is the only one (efficient)")
    once_from: int = number(1, 1, 1000, "frames", "with a proposal, before that only view is taken")
    likely_again: float = number(0.1, 0.0, 1.0, "", "the same of what is settled, or took its class over")
    box_weight: float = number(0.75, 0.0, 1.0, "", "say of a box that has changed since the view fused last")
    slip: float = number(0.1, 0.0, 1.0, "", "probability that a track's proposal is something else for the moment")
    bearing_deg: float = number(40.0, 0.0, 180.0, "deg", "change of view that makes it independent")
    range_ratio: float = number(0.4, 0.0, 10.0, "", "change of distance that makes it independent")
    extent_ratio: float = number(0.6, 0.0, 10.0, "", "change of size that makes it independent")
    reopen_ratio: float | None = number(
        1.5, 1.0, 1000.0, "", "times the points, and five more, that raise doubt; none: never"
    )
    reopen_points: int = number(400, 0, 10000, "", "a class settled from so many is never doubted")
    start_frame: int = number(5, 1, 1000, "frames", "age of a track from which views are fused")
