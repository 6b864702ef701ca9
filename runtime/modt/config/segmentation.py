"""Segmentation."""

from __future__ import annotations

from dataclasses import dataclass

from modt.config.base import StageConfig, number


@dataclass(frozen=True, slots=True, kw_only=True)
class SegmentationConfig(StageConfig):
    """Ground, clusters and the sizes of what can be an object (section III-A)."""

    max_slope_deg: float = number(12.0, 0.5, 45.0, "deg", "of the ground")
    clearance_m: float = number(0.25, 0.02, 1.0, "m", "above ground, from where on points make objects")
    max_height_m: float = number(2.6, 0.3, 20.0, "m", "above ground; what hangs higher joins nothing")
    cell_m: float = number(0.105, 0.01, 2.0, "m", "side of a cell at 10 m; grows as the square root of range")
    min_points: int = number(5, 1, 1000, "", "of a proposal")
    max_extent_m: float = number(13.0, 0.5, 50.0, "m", "longest side of a proposal")
    min_height_m: float = number(0.2, 0.0, 3.0, "m", "lowest proposal")
