"""Classification, its budget, and fusion."""

from __future__ import annotations

from dataclasses import dataclass, field

from modt.classes import CLASSES
from modt.config.base import StageConfig, choice, mechanism, number, per_class, shares


@dataclass(frozen=True, slots=True, kw_only=True)
class ClassificationConfig(StageConfig):
    """The network and its input (section V-A)."""

    model: str = field(default="pointnet-kitti", metadata={"meaning": "name in models/ or path of an .onnx file"})
    likelihood: str = choice(
        "pooled", ("pooled", "network"), "of the network with the classifiers of box and reflectance, or of it alone"
    )
    max_points: int = number(128, 8, 4096, "", "points of a proposal handed to the network")
    min_points: int = number(1, 1, 4096, "", "to which they are repeated, which costs more and changes no class")
    batch: int = number(4, 1, 256, "", "proposals of one network call at most")


@dataclass(frozen=True, slots=True, kw_only=True)
class CallWorthConfig(StageConfig):
    """Worth of a classification, which decides who comes first where the budget binds; set by hand."""

    uncertainty_weight: float = number(0.4, 0.0, 1.0, "", "of the normalised entropy of the posterior")
    nearness_weight: float = number(0.3, 0.0, 1.0, "", "of exp(-distance / range_scale_m)")
    novelty_weight: float = number(0.3, 0.0, 1.0, "", "of the relative change of points since the last view")
    range_scale_m: float = number(30.0, 1.0, 1000.0, "m", "distance at which nearness is 1/e")
    waiting_weight: float = number(0.1, 0.001, 10.0, "", "added per frame of waiting, so that every call is made")


@dataclass(frozen=True, slots=True, kw_only=True)
class CostModelConfig(StageConfig):
    """The CPU time of a classification, fitted to the latest frames."""

    forgetting: float = number(0.98, 0.5, 1.0, "", "weight of the past per frame")
    margin: float = number(1.5, 1.0, 10.0, "", "of the estimate over the fit, at the start")
    margin_step: float = number(0.05, 0.001, 1.0, "", "by which an underestimate raises the margin's logarithm")


@dataclass(frozen=True, slots=True, kw_only=True)
class SchedulerConfig(StageConfig):
    """Budget of classification per frame; none: unlimited."""

    calls_per_frame: int | None = number(16, 0, 10000, "", "proposals classified")
    cpu_ms_per_frame: float | None = number(None, 0.0, 10000.0, "ms", "CPU time, on average over a second")
    energy_mJ_per_frame: float | None = number(None, 0.0, 100000.0, "mJ", "above idle, on average over a second")
    worth: CallWorthConfig = mechanism(CallWorthConfig)
    cost: CostModelConfig = mechanism(CostModelConfig)


@dataclass(frozen=True, slots=True, kw_only=True)
class DecisionConfig(StageConfig):
    """The class that is said of a track."""

    missed_cost: tuple[float, ...] = per_class(
        "missed_cost", 0.01, 1000.0, "cost of a missed object over that of a false one; 1: said from 1/2 on"
    )
    hysteresis: float = number(0.4, 0.01, 1.0, "", "share of that posterior that the class said last needs; 1: none")
    frequency: tuple[float, ...] | None = shares(
        0.33, "of the classes among proposals, at the start; null: those that the model assumes"
    )
    start_proposals: int = number(2000, 1, 100_000_000, "", "that the frequency at the start counts for")
    memory_proposals: int = number(20_000, 1, 100_000_000, "", "that the frequency of the stream is estimated from")
    max_change: float = number(5.0, 1.0, 1000.0, "", "of a frequency, over that which the model assumes")


@dataclass(frozen=True, slots=True, kw_only=True)
class FusionConfig(StageConfig):
    """Views, boxes and motion fused to a class, and final classes (section V-C, Figs. 10 and 11).

    background_threshold: mode accurate; first_view_min_hits: mode efficient; start_frame, point_change: rule product.
    """

    rule: str = choice("mean", ("mean", "product"), "of fusing views; product: Equation 6, of the paper")
    prior: tuple[float, ...] = per_class("prior", 0.0, 0.33, "frequency that a model assumes which states none")
    object_threshold: float = number(0.9, 0.25, 1.0, "", "posterior at which a class is final")
    background_threshold: float = number(0.5, 0.25, 1.0, "", "posterior under equal frequencies; final background")
    min_object_probability: float = number(0.1, 0.0, 1.0, "", "by box and motion, to be classified")
    first_view_min_hits: int = number(2, 1, 1000, "frames", "with a proposal, to be classified")
    start_frame: int = number(4, 1, 1000, "frames", "age of a track from which views are fused")
    point_change: tuple[float, ...] = per_class(
        "point_change", 0.0, 10.0, "relative change of points (Equation 4) of an independent view", tuple(CLASSES)
    )
