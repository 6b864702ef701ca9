"""Configuration of the classification and of its budget."""

from __future__ import annotations

from dataclasses import dataclass, field

from modt.config.fields import StageConfig, choice, number

BATCH = 8
"""Proposals of one network call: few enough for their features to stay in the cache."""


@dataclass(frozen=True, kw_only=True)
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
        """Number of points to which a smaller proposal is repeated; more costs CPU time and changes no class."""
        return 1 if self.likelihood == "pooled" else self.max_points


@dataclass(frozen=True, kw_only=True)
class SchedulerConfig(StageConfig):
    """Budget of classification. Null means no limit, and the limit that is reached first applies."""

    calls_per_frame: int | None = number(24, 0, 10000, "", "Greatest number of proposals classified in a frame.")
    cpu_ms_per_frame: float | None = number(
        None, 0.0, 10000.0, "ms", "CPU time of classification in a frame, on average over a second."
    )
    energy_mJ_per_frame: float | None = number(
        None, 0.0, 100000.0, "mJ", "Energy of classification in a frame above idling, on average over a second."
    )
