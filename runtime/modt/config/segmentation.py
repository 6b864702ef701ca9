"""Configuration of the segmentation."""

from __future__ import annotations

from dataclasses import dataclass

from modt.config.fields import StageConfig, choice, number

NATIVE = "native"
NUMPY = "numpy"
KERNELS = ("auto", NATIVE, NUMPY)
"""Names of the code for points."""


@dataclass(frozen=True, kw_only=True)
class SegmentationConfig(StageConfig):
    """Ground, clusters, and the sizes that an object can have (section III-A)."""

    max_slope_deg: float = number(
        16.0,
        0.5,
        45.0,
        "deg",
        "Greatest change of the slope of the ground along a ray; the ground is at most twice as steep.",
    )
    clearance_m: float = number(0.25, 0.02, 1.0, "m", "Height above the ground from which points belong to objects.")
    max_height_m: float = number(2.6, 0.3, 20.0, "m", "Height above the ground up to which points belong to objects.")
    cell_m: float = number(
        0.105, 0.01, 2.0, "m", "Side of a cell at 10 m. It grows with the square root of the range."
    )
    min_points: int = number(5, 1, 1000, "", "Least number of points of a proposal.")
    max_extent_m: float = number(20.0, 0.5, 50.0, "m", "Greatest length of a proposal.")
    min_height_m: float = number(0.2, 0.0, 3.0, "m", "Least height of a proposal.")
    kernels: str = choice(
        "auto",
        KERNELS,
        "Code for points: compiled (native), NumPy (numpy), or compiled where it can be (auto). "
        "The environment variable MODT_KERNELS overrules this key.",
    )
