"""Solid cells and porous ones: a surface stops the rays that meet it, most rays pass through fog, dust and flakes.

Index space: C occupied cells of the fine grid.
"""

from __future__ import annotations

import numpy as np

from modt.config import SensorConfig
from modt.segmentation.cells import AirOfCells, Cells
from modt.segmentation.clusters import Clusters
from modt.segmentation.grids import FAR_M, SqrtRangeGrid
from modt.segmentation.groups import Groups
from modt.segmentation.tuning import PorosityTuning
from modt.types import NONE, Bool, Float32, Float64, Int

WINDOW = 3
"""Side of the window of cells in which returns are counted."""
DIRECTIONS = 24
"""Number of directions around the sensor in which returns are counted."""


class RayDensity:
    """Density of the rays of a sensor, over the one of its profile.

    It is that of the densest part of the view in the first sweeps, 1 at most. A head that turns faster, or a driver
    that thins the sweep, makes it less. Two denser directions are left out, in case a driver sets rays without a
    return to one place.

    Args:
        sensor: spacing of the rays.

    Attributes:
        in_view: (DIRECTIONS,) directions from which returns came.
    """

    SWEEPS = 5
    PART_RAD = 2 * np.pi / DIRECTIONS  # height and width of a part of the view
    LEFT_OUT = 2

    def __init__(self, sensor: SensorConfig) -> None:
        self.density = 0.0
        self.in_view = np.zeros(DIRECTIONS, np.bool_)
        self._azimuth_step_rad = np.deg2rad(sensor.azimuth_step_deg)
        self._beams = sensor.beams
        self._low_rad, high_rad = np.deg2rad(sensor.assumed_span_deg)
        self._rows = max(round((high_rad - self._low_rad) / self.PART_RAD), 1)
        self._row_rad = (high_rad - self._low_rad) / self._rows
        self._left = self.SWEEPS

    def update(self, points: Float32) -> None:
        """Look at (N, 4) points of a sweep, unless enough were seen."""
        if not self._left:
            return
        self._left -= 1
        x, y, z = points[:, :3].T
        extent = np.abs(points[:, :3]).max(axis=1, initial=0.0)
        seen = (extent > 0) & (extent < FAR_M)  # NaN is neither
        direction = direction_of(x[seen], y[seen])
        tangent = z[seen] / np.maximum(np.hypot(x[seen], y[seen]), np.float32(1e-3))
        row = np.floor((np.arctan(tangent) - self._low_rad) / self._row_rad).astype(np.int64)
        inside = (row >= 0) & (row < self._rows)
        solid_angle = np.broadcast_to(self._beams.step_rad(tangent) * self._azimuth_step_rad, tangent.shape)
        part = (row * DIRECTIONS + direction)[inside]
        of_part = np.bincount(part, solid_angle[inside], self._rows * DIRECTIONS).reshape(self._rows, -1)
        self.in_view |= of_part.any(axis=0)
        # Of each row of parts, the densest but LEFT_OUT of them; of all rows, the densest one.
        densest = float(np.sort(of_part)[:, -1 - self.LEFT_OUT].max())
        self.density = min(max(self.density, densest / (self.PART_RAD * self._row_rad)), 1.0)


def direction_of(x: Float32, y: Float32) -> Int:
    """(N,) direction, of DIRECTIONS, in which each place lies."""
    direction: Int = np.floor(np.arctan2(y, x) * (DIRECTIONS / (2 * np.pi))).astype(np.int64) % DIRECTIONS
    return direction


def mean_solidity(found: Clusters, label: Int, n: int) -> Float64:
    """(n,) mean solidity of the points of each label, given (C,) the label of each cell; 1 without points."""
    points = found.cells.entries
    count = np.bincount(label, points, n)
    total = np.bincount(label, points * found.air.solidity, n)
    return np.divide(total, count, out=np.ones(n), where=count > 0)


class PorosityFinder:
    """Measures how solid cells are, and finds returns from the air.

    The solidity of a cell is the number of returns in the window of cells around it, over the number of rays that
    cross the window between its lowest and its highest return. A surface across the window has 1. A single return has
    none, because one ray tells nothing of its neighbours. A cell is airborne where its own solidity and that of all
    its neighbours are too low, so that the edge of a surface stays with it. Within
    `point_range_m` each point is also judged alone, in a window that ends a little below and above it, so that fog
    above a head is recognised although it is in the cell of the head.

    Args:
        sensor: spacing of the rays.
        grid: the fine grid.
        tuning: bounds on what is airborne.
    """

    def __init__(self, sensor: SensorConfig, grid: SqrtRangeGrid, tuning: PorosityTuning = PorosityTuning()) -> None:
        self.grid = grid
        self.min_solidity = np.float32(tuning.min_solidity)
        self.reach_m = np.float32(tuning.reach_m)
        self.reach_beams = np.float32(tuning.reach_beams)
        self.point_sqrt_range = np.float32(np.sqrt(tuning.point_range_m))
        self.max_sqrt_range = np.float32(np.sqrt(tuning.max_range_m))
        self.tuning = tuning
        self.rays = RayDensity(sensor)
        self._rays_per_direction = sensor.rays_per_turn / DIRECTIONS
        # A window is WINDOW * step * sqrt(range) wide, and returns of a beam are range * azimuth_step apart.
        self._usual_rays = WINDOW * grid.step / np.deg2rad(sensor.azimuth_step_deg)

    @property
    def rays_sqrt_range(self) -> np.float32:
        """Rays of a beam across a window, times the square root of its range [sqrt(m)]."""
        return np.float32(self.rays.density * self._usual_rays)

    def air(self, cells: Cells, sqrt_range: Float32, beam_m: Float32) -> AirOfCells:
        """Solidity of C cells.

        Args:
            cells: occupied cells.
            sqrt_range: (C,) square root of the range of each [sqrt(m)].
            beam_m: (C,) vertical distance of neighbouring beams there [m].
        """
        near = np.flatnonzero(sqrt_range < self.max_sqrt_range)
        around = self._around(cells, near)
        # Row C, the last of these columns, stands for no cell: NONE is -1, which wraps to it.
        returns = np.append(cells.entries, 0).take(around, mode="wrap").sum(axis=1)
        low = np.append(cells.low, np.float32(np.inf)).take(around, mode="wrap").min(axis=1)
        high = np.append(cells.high, np.float32(-np.inf)).take(around, mode="wrap").max(axis=1)
        rays = self._rays_across(sqrt_range.take(near)) * ((high - low) / beam_m.take(near) + np.float32(1.0))
        solidity = np.ones(len(cells) + 1, np.float32)
        solidity[near] = np.where(returns > 1, returns.astype(np.float32) / rays, np.float32(0.0))
        solidity[NONE] = 0.0
        airborne = np.zeros(len(cells), np.bool_)
        airborne[near] = solidity.take(around, mode="wrap").max(axis=1) < self.min_solidity
        n_looked_at = int(cells.entries.take(near).sum())
        n_airborne = int(cells.entries[airborne].sum())
        return AirOfCells(beam_m, solidity[:-1], airborne, n_airborne, n_airborne / max(n_looked_at, 1))

    def is_full(self, found: Clusters) -> bool:
        """Whether the air of a sweep is full of fog, flakes or drops all round, or of a cloud nearby.

        It is full if airborne returns are a large share of those looked at, or fill most directions. Leaves, through
        which most rays also pass, do neither.
        """
        air = found.air
        if air.share > self.tuning.max_sweep_share:
            return True
        n_in_view = np.count_nonzero(self.rays.in_view)
        enough = self.tuning.min_air_rays * self.rays.density * self._rays_per_direction
        min_directions = self.tuning.min_directions * n_in_view
        if air.returns < min_directions * enough:
            return False
        cells = np.flatnonzero(air.airborne)
        direction = direction_of(found.sampled.x.take(cells), found.sampled.y.take(cells))
        returns = np.bincount(direction, found.cells.entries.take(cells), DIRECTIONS)[self.rays.in_view]
        return bool(np.count_nonzero(returns >= enough) >= min_directions > 0)

    def airborne_points(self, found: Clusters) -> Bool:
        """(K,) airborne points: those of airborne cells, and those without enough others close by."""
        cells_near = np.flatnonzero(found.sampled.sqrt_range < self.point_sqrt_range)
        around = self._around(found.cells, cells_near)
        beam_m = found.air.beam_m.take(cells_near)
        reach_m = np.maximum(self.reach_m, self.reach_beams * beam_m)
        columns = self._rays_across(found.sampled.sqrt_range.take(cells_near))
        enough = self.min_solidity * columns * (np.float32(2.0) * reach_m / beam_m + np.float32(1.0))
        points_of_cell = Groups.from_labels(found.cell_of_point, len(found.cells))
        members = np.split(points_of_cell.rows, points_of_cell.offsets[1:-1])
        is_air = np.zeros(len(found.height), np.bool_)
        for i, cell in enumerate(cells_near.tolist()):
            own = members[cell]
            close = np.concatenate([members[other] for other in around[i].tolist() if other != NONE])
            apart_m = np.abs(found.height[own][:, None] - found.height[close])
            count = (apart_m <= reach_m[i]).sum(axis=1)
            is_air[own] = count.astype(np.float32) < enough[i]
        return is_air | found.air.airborne.take(found.cell_of_point)

    def _around(self, cells: Cells, which: Int) -> Int:
        """(R, WINDOW * WINDOW) cells in the windows around `which` (R,), NONE where no cell is occupied.

        The numbers of the cells are written to `grid.number`, and taken back at the end.
        """
        index = self.grid.flat_index(cells.row, cells.column)
        self.grid.number[index] = np.arange(len(index), dtype=np.int32)
        step = np.arange(WINDOW) - WINDOW // 2
        window = (step[:, None] * self.grid.side + step).ravel()
        around = self.grid.number.take(index.take(which)[:, None] + window)
        self.grid.number[index] = NONE
        return around.astype(np.int64)

    def _rays_across(self, sqrt_range: Float32) -> Float32:
        """(R,) rays of a beam that cross the window of cells at a range, 1 at least."""
        rays: Float32 = np.maximum(self.rays_sqrt_range / sqrt_range, np.float32(1.0))
        return rays
