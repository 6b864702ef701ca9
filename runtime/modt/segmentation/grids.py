"""Grids over the ground plane around the sensor, spaced by the square root of range."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from modt.geometry import pseudo_angle
from modt.segmentation.tuning import PolarGridTuning
from modt.types import NONE, Float32, Float64, Int, Self

FAR_M = np.float32(1e6)
"""Farther than any return: cells of points nearer can be numbered."""


@dataclass(frozen=True)
class PointColumns:
    """Points of a sweep, one contiguous column a coordinate: the fastest layout for vectorised arithmetic."""

    x: Float32  # (N,) [m, sensor frame]
    y: Float32
    z: Float32
    sqrt_range: Float32  # (N,) square root of the horizontal range [sqrt(m)], the unit of the grids

    def __len__(self) -> int:
        return len(self.x)

    @classmethod
    def from_array(cls, points: Float32) -> Self:
        """Columns of (N, 3) or wider points; one without a position within FAR_M is taken to the sensor."""
        columns = np.ascontiguousarray(points[:, :3].T, np.float32)
        if columns.size and not (columns.min() > -FAR_M and columns.max() < FAR_M):  # NaN is neither
            columns[:, ~(np.abs(columns) < FAR_M).all(axis=0)] = 0.0
        x, y, z = columns
        return cls(x, y, z, np.sqrt(np.sqrt(x * x + y * y)))

    def take(self, rows: Int) -> Self:
        """Rows by index."""
        return type(self)(self.x.take(rows), self.y.take(rows), self.z.take(rows), self.sqrt_range.take(rows))

    def part(self, first: int, end: int) -> Self:
        """Rows from `first` to before `end`."""
        rows = slice(first, end)
        return type(self)(self.x[rows], self.y[rows], self.z[rows], self.sqrt_range[rows])

    def xyz(self) -> Float32:
        """(N, 3) positions [m]."""
        return np.stack([self.x, self.y, self.z], axis=1)


Int32 = NDArray[np.int32]

SECTORS = 128
"""Sectors of the polar grid, a power of two, so that the compiled passes number cells by shifts."""


class PolarGrid:
    """Rings of equal width in the square root of range, sectors of equal pseudo-angle.

    Args:
        max_range_m: outer edge; farther points belong to the last ring.
        tuning: width of a ring, and what is flat in a cell.
    """

    def __init__(self, max_range_m: float, tuning: PolarGridTuning) -> None:
        self.ring_step = tuning.ring_step
        self.rings_per_unit = 1 / tuning.ring_step  # [1/sqrt(m)]
        self.rings = int(np.sqrt(max_range_m) / tuning.ring_step) + 2
        self.size = self.rings * SECTORS
        edge_m = (np.arange(self.rings + 1) * tuning.ring_step) ** 2
        # (rings + 1,) range of the edges of the rings [m].
        self.edge_m: Float32 = edge_m.astype(np.float32)
        # (rings,) range of the middle of each ring [m].
        self.range_m: Float32 = ((edge_m[1:] + edge_m[:-1]) / 2).astype(np.float32)
        # (rings,) height range of the returns of a cell above which something stands in it [m].
        self.flat_m: Float64 = tuning.flat_m + tuning.flat_slope * np.diff(edge_m)

    def cell(self, points: PointColumns) -> Int:
        """(N,) index of each point's cell: ring * SECTORS + sector."""
        ring = (points.sqrt_range * np.float32(self.rings_per_unit)).astype(np.int32)
        np.minimum(ring, self.rings - 1, out=ring)
        turn = pseudo_angle(points.x, points.y)
        turn *= np.float32(SECTORS / 4)
        sector = turn.astype(np.int32)
        sector &= SECTORS - 1
        ring *= SECTORS
        ring += sector
        return ring.astype(np.int64)


class SqrtRangeGrid:
    """Square grid over the plane in which a point at range r lies at sqrt(r) in its direction.

    A cell of side s covers s sqrt(r) metres across the ray and twice that along it, as the spacing of the returns
    grows with range, more so along the ray.

    Args:
        step: side of a cell [sqrt(m)].
        max_range_m: outer edge.
    """

    def __init__(self, step: float, max_range_m: float) -> None:
        self.step = step
        self.centre = 2 * (int(np.sqrt(max_range_m) / (2 * step)) + 2)
        self.side = 2 * self.centre
        self.number: Int32 = np.full(self.side * self.side, NONE, np.int32)  # NONE throughout between calls

    def row_column(self, points: PointColumns) -> tuple[Int32, Int32]:
        """(K,) row and (K,) column of each point."""
        scale = np.float32(1 / self.step) / points.sqrt_range
        row = (points.x * scale + np.float32(self.centre)).astype(np.int32)
        column = (points.y * scale + np.float32(self.centre)).astype(np.int32)
        return row, column

    def flat_index(self, row: Int32, column: Int32) -> Int:
        """(K,) row-major index."""
        return (row * np.int32(self.side) + column).astype(np.int64)

    def occupied(self, index: Int) -> tuple[Int, Int]:
        """(C,) last point of each occupied cell, and (K,) occupied cell of each point, given (K,) flat indices.

        Neither sort nor search: each point writes its number into its cell; the numbers left are the last points.
        """
        number = np.arange(len(index), dtype=np.int32)
        self.number[index] = number
        sample = np.flatnonzero(self.number.take(index) == number)
        taken = index[sample]
        self.number[taken] = number[: len(sample)]
        cell = self.number.take(index).astype(np.int64)
        self.number[taken] = NONE
        return sample, cell

    def neighbour_pairs(self, index: Int) -> tuple[Int, Int32]:
        """Pairs (i, j) of the cells at (C,) flat indices that share a side or a corner, each once, sorted by i."""
        self.number[index] = np.arange(len(index), dtype=np.int32)
        # Four of the eight neighbours: the other four have the cell among theirs, and each pair is wanted once.
        ahead = np.array([1, self.side - 1, self.side, self.side + 1])
        found = self.number.take((index[:, None] + ahead).ravel())
        self.number[index] = NONE
        pair = np.flatnonzero(found != NONE)
        return pair >> 2, found.take(pair)  # each cell has four places in `found`
