"""Grids over the plane around the sensor, spaced by the square root of range."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from modt.segmentation.columns import Columns
from modt.types import NONE, Float32, Int

Int32 = NDArray[np.int32]

SECTORS = 128
RING_STEP = 0.15
"""Rings lie this far apart in the square root of range [sqrt(m)]: 0.9 m at 10 m, 1.9 m at 40 m."""


def pseudo_angle(x: Float32, y: Float32) -> Float32:
    """(N,) direction as a number from 0 to 4 that grows with the angle from -90 degrees; no arctangent."""
    turn = np.abs(x)
    turn += np.abs(y)
    np.maximum(turn, np.float32(1e-6), out=turn)
    np.divide(y, turn, out=turn)
    np.subtract(np.float32(2.0), turn, out=turn, where=x < 0)
    turn += np.float32(1.0)
    return turn


class PolarGrid:
    """Cells around the sensor: rings that widen with range, sectors of a pseudo-angle that needs no arctangent.

    Args:
        max_range_m: how far the rings reach.
    """

    def __init__(self, max_range_m: float) -> None:
        self.rings = int(np.sqrt(max_range_m) / RING_STEP) + 2
        self.size = self.rings * SECTORS
        edge = (np.arange(self.rings + 1) * RING_STEP) ** 2
        self.range_m: Float32 = ((edge[1:] + edge[:-1]) / 2).astype(np.float32)

    def cell(self, points: Columns) -> Int:
        """(N,) cell of each point, ring by ring; points beyond the last ring belong to it."""
        ring = (points.root * np.float32(1 / RING_STEP)).astype(np.int32)
        np.minimum(ring, self.rings - 1, out=ring)
        turn = pseudo_angle(points.x, points.y)
        turn *= np.float32(SECTORS / 4)
        sector = turn.astype(np.int32)
        sector &= SECTORS - 1
        ring *= SECTORS
        ring += sector
        return ring.astype(np.int64)


class RootGrid:
    """A square grid over the plane drawn in by the square root of range.

    A point at range r moves to sqrt(r) in its direction. A cell of side s in that plane covers s sqrt(r) across the
    ray and twice that along it: as the sensor's spacing grows with range, and more so along the ray, so do the cells.

    Args:
        step: side of a cell [sqrt(m)].
        max_range_m: how far it reaches.
    """

    def __init__(self, step: float, max_range_m: float) -> None:
        self.step = step
        self.centre = 2 * (int(np.sqrt(max_range_m) / (2 * step)) + 2)
        self.side = 2 * self.centre
        self._number: Int32 = np.full(self.side * self.side, NONE, np.int32)

    def row_and_column(self, points: Columns) -> tuple[Int32, Int32]:
        """(K,) place of each point in the grid."""
        scale = np.float32(1 / self.step) / points.root
        row = (points.x * scale + np.float32(self.centre)).astype(np.int32)
        column = (points.y * scale + np.float32(self.centre)).astype(np.int32)
        return row, column

    def place(self, row: Int32, column: Int32) -> Int:
        """(K,) the same as one number, row by row."""
        return (row * np.int32(self.side) + column).astype(np.int64)

    def occupy(self, place: Int) -> tuple[Int, Int]:
        """(C,) one point of each occupied cell, its last, and (K,) the cell of each point.

        No sort and no search of the grid: every point writes its name in its cell, and those whose name still
        stands there speak for theirs.
        """
        name = np.arange(len(place), dtype=np.int32)
        self._number[place] = name
        sample = np.flatnonzero(self._number.take(place) == name)
        taken = place[sample]
        self._number[taken] = name[: len(sample)]
        cell = self._number.take(place).astype(np.int64)
        self._number[taken] = NONE
        return sample, cell

    def beside(self, place: Int) -> tuple[Int, Int32]:
        """Pairs of cells, by number, that touch at a side or a corner: each pair once, ordered by the first."""
        self._number[place] = np.arange(len(place), dtype=np.int32)
        ahead = np.array([1, self.side - 1, self.side, self.side + 1])
        found = self._number.take((place[:, None] + ahead).ravel())
        self._number[place] = NONE
        pair = np.flatnonzero(found != NONE)
        return pair >> 2, found.take(pair)
