"""Segmentation: the keys of the stage. Limits of a mechanism are constants beside it.

Defaults without another source were chosen on KITTI object frames and labelled odometry scans, and checked on drive
0005 and on simulated streets (docs/segmentation.md).
"""

from __future__ import annotations

from dataclasses import dataclass

from modt.config.base import StageConfig, choice, number

KERNELS = AUTO, NATIVE, NUMPY = "auto", "native", "numpy"


@dataclass(frozen=True, slots=True, kw_only=True)
class SegmentationConfig(StageConfig):
    """Ground, clusters and the sizes of what can be an object (section III-A)."""

    max_slope_deg: float = number(16.0, 0.5, 45.0, "deg", "steepest ground, up or down; what rises more stands on it")
    clearance_m: float = number(0.25, 0.02, 1.0, "m", "lowest point of an object above ground")
    max_height_m: float = number(2.6, 0.3, 20.0, "m", "highest point of an object above ground")
    cell_m: float = number(0.105, 0.01, 2.0, "m", "side of a cell at 10 m; grows as the square root of range")
    min_points: int = number(5, 1, 1000, "", "of a proposal")
    max_extent_m: float = number(9.0, 0.5, 50.0, "m", "longest side of a proposal")
    min_height_m: float = number(0.2, 0.0, 3.0, "m", "lowest proposal")
    kernels: str = choice(
        "auto", KERNELS, "passes over points: compiled where they can be, or NumPy; the variable MODT_KERNELS wins"
    )
