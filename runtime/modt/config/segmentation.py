"""Segmentation: the keys of the stage, and one nested dataclass a mechanism.

Defaults without another source were chosen on KITTI object frames and labelled odometry scans, and checked on drive
0005 and on simulated streets (docs/segmentation.md).
"""

from __future__ import annotations

from dataclasses import dataclass

from modt.config.base import StageConfig, choice, mechanism, number

KERNELS = AUTO, NATIVE, NUMPY = "auto", "native", "numpy"


@dataclass(frozen=True, slots=True, kw_only=True)
class SensorHeightConfig(StageConfig):
    """Estimation of the height of the sensor, where sensor.height_m is null."""

    default_m: float = number(1.73, 0.05, 5.0, "m", "without visible ground; KITTI's sensor")
    sweeps: int = number(5, 1, 100, "frames", "first sweeps whose median is the estimate")
    max_range_m: float = number(15.0, 1.0, 100.0, "m", "of the ground cells used")
    bin_m: float = number(0.05, 0.005, 0.5, "m", "of the histogram of depths below the sensor")
    min_cells: int = number(12, 1, 1000, "", "in three bins that count as ground")
    horizon_beams: float = number(2.0, 0.0, 20.0, "beams", "below the horizon, whose returns are left out")


@dataclass(frozen=True, slots=True, kw_only=True)
class GroundConfig(StageConfig):
    """Ground as piece-wise planes (section III-A), traced outwards along each ray of a polar grid."""

    noise_m: float = number(0.1, 0.0, 1.0, "m", "residual of a lowest return on the plane of its ray")
    near_m: float = number(
        1.5, 0.0, 20.0, "m", "of a rise by max_slope_deg, at most, from one ground cell of a ray to the next"
    )
    ramp_share: float = number(0.3, 0.0, 1.0, "", "of max_slope_deg: running slope of a ray that is on a ramp")
    slope_gain: float = number(0.2, 0.01, 1.0, "", "weight of the newest slope in the running slope of a ray")
    max_gap_m: float = number(6.0, 0.1, 100.0, "m", "the same on and beside a ramp; reach of the running slope")
    flat_m: float = number(0.1, 0.0, 1.0, "m", "height range of the returns of a flat cell ...")
    flat_slope: float = number(0.2, 0.0, 2.0, "", "... and what it grows by with the width of the cell")
    flank_sectors: int = number(3, 1, 60, "", "to the left and right of a ray, whose median bounds its surface")
    flank_m: float = number(0.25, 0.0, 100.0, "m", "above that median, from where on a surface is a vehicle's side")


@dataclass(frozen=True, slots=True, kw_only=True)
class ClusterConfig(StageConfig):
    """Connection of grid cells, and what is kept of a cluster larger than max_extent_m."""

    max_gap_m: float = number(0.3, 0.0, 5.0, "m", "vertical gap between neighbouring cells of one cluster ...")
    max_gap_beams: float = number(2.0, 0.0, 20.0, "beams", "... and what it grows by, at the range of the cell")
    min_line_points: int = number(
        15, 1, 1000, "", "of a cluster lower than min_height_m: an object that one beam meets"
    )
    min_line_top_m: float = number(0.5, 0.0, 5.0, "m", "top above ground of such a cluster")
    min_part_top_m: float = number(0.9, 0.0, 5.0, "m", "top above ground of a part of an oversized cluster")
    min_part_points: int = number(15, 1, 1000, "", "of a part of an oversized cluster")


@dataclass(frozen=True, slots=True, kw_only=True)
class PersonSplitConfig(StageConfig):
    """A person split off the cluster of what is near, on the fine grid."""

    min_cluster_m: float = number(0.8, 0.0, 10.0, "m", "extent of a cluster that may hold a person and more")
    min_cell_returns: float = number(
        0.9, 0.0, 10.0, "", "width of a fine cell over the spacing of returns; else one object is split"
    )
    min_extent_m: float = number(0.2, 0.0, 2.0, "m", "of a person from above")
    max_extent_m: float = number(1.3, 0.1, 3.0, "m", "of a person from above, in stride")
    min_top_m: float = number(1.1, 0.0, 3.0, "m", "head of a person above ground: a child of five")
    max_top_m: float = number(2.2, 0.5, 5.0, "m", "head of a person above ground: a tall person on a kerb")
    min_height_m: float = number(0.5, 0.0, 3.0, "m", "top less bottom of what is seen of a person")
    min_points: int = number(8, 1, 1000, "", "of a person")


@dataclass(frozen=True, slots=True, kw_only=True)
class CarMergeConfig(StageConfig):
    """Merging of the strips that few beams show of one car."""

    max_diagonal_m: float = number(6.0, 0.5, 30.0, "m", "of a strip and of the merged car")
    min_width_m: float = number(0.7, 0.0, 10.0, "m", "of the merged car, across the ray")
    max_width_m: float = number(5.2, 0.5, 30.0, "m", "of the merged car, across the ray")
    min_top_m: float = number(0.8, 0.0, 5.0, "m", "of the merged car above ground")
    max_top_m: float = number(2.2, 0.5, 10.0, "m", "of the merged car above ground")
    max_bottom_m: float = number(0.8, 0.0, 5.0, "m", "of the merged car above ground")
    max_gap_m: float = number(1.8, 0.0, 10.0, "m", "in range between two strips; the length of a bonnet")
    min_gap_beams: float = number(-1.0, -20.0, 20.0, "beams", "in elevation from the nearer strip to the farther")
    max_gap_beams: float = number(2.0, -20.0, 20.0, "beams", "in elevation from the nearer strip to the farther")
    max_person_width_m: float = number(0.9, 0.0, 3.0, "m", "of a strip that may be a person and is not merged")
    min_person_top_m: float = number(1.1, 0.0, 3.0, "m", "above ground of such a strip")
    min_person_height_m: float = number(0.7, 0.0, 3.0, "m", "top less bottom of such a strip")
    visible_m: float = number(1.5, 0.1, 5.0, "m", "height of a car ...")
    max_beams: float = number(8.0, 1.0, 200.0, "beams", "... and the beams on it, from which cars are whole")
    min_points: int = number(2, 1, 1000, "", "of a strip")


@dataclass(frozen=True, slots=True, kw_only=True)
class ViewMarginConfig(StageConfig):
    """Segmentation beyond the edge of a limited field of view."""

    margin_m: float = number(6.0, 0.0, 50.0, "m", "outside the view within which points are segmented")
    object_m: float = number(1.0, 0.0, 10.0, "m", "outside the view of a proposal that still counts as in view")
    truncation_m: float = number(0.3, 0.0, 10.0, "m", "from the end of the margin to a truncated proposal")


@dataclass(frozen=True, slots=True, kw_only=True)
class BoxConfig(StageConfig):
    """Heading of a box by closeness to its sides."""

    noise_m: float = number(0.1, 0.001, 1.0, "m", "points nearer to a side lie on it")
    max_cells: int = number(32, 1, 10000, "", "of a proposal that decide on its heading")


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
    sensor_height: SensorHeightConfig = mechanism(SensorHeightConfig)
    ground: GroundConfig = mechanism(GroundConfig)
    clusters: ClusterConfig = mechanism(ClusterConfig)
    person_splitting: PersonSplitConfig = mechanism(PersonSplitConfig)
    car_merging: CarMergeConfig = mechanism(CarMergeConfig)
    view_margin: ViewMarginConfig = mechanism(ViewMarginConfig)
    boxes: BoxConfig = mechanism(BoxConfig)
