"""Euclidean clusters: occupied cells of a bird's-eye grid whose spacing grows with range, joined where they touch."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components

from modt.segmentation.columns import Columns
from modt.types import NONE, Int

Int32 = NDArray[np.int32]


@dataclass(frozen=True, slots=True)
class Cells:
    """Occupied cells, in the order of their keys.

    Attributes:
        key: (C,) place in the grid.
        number: (side * side,) number of the cell at each place, NONE where it is empty.
        of_point: (K,) cell of each point.
        sample: (C,) one point of each cell, the last.
    """

    key: Int
    number: Int32
    of_point: Int32
    sample: Int

    def __len__(self) -> int:
        return len(self.key)


class RootGrid:
    """A square grid over the plane drawn in by the square root of range.

    A point at range r moves to sqrt(r) in its direction. A cell of that plane covers c sqrt(r) across the ray and
    twice that along it: as the sensor's spacing grows with range, and more so along the ray, so do the cells.

    Args:
        cell_m: side of a cell across the ray at 10 m.
        max_range_m: how far it reaches.
    """

    def __init__(self, cell_m: float, max_range_m: float) -> None:
        self.step = cell_m / np.sqrt(10.0)
        self.centre = int(np.sqrt(max_range_m) / self.step) + 3
        self.side = 2 * self.centre

    def cells(self, points: Columns) -> Cells:
        """Occupied cells of (K,) points within the range."""
        scale = np.float32(1 / self.step) / points.root
        middle = np.float32(self.centre)
        place = (points.x * scale + middle).astype(np.int32)
        place *= self.side
        place += (points.y * scale + middle).astype(np.int32)
        occupied = np.zeros(self.side * self.side, np.bool_)
        occupied[place] = True
        key = np.flatnonzero(occupied)
        number = np.full(self.side * self.side, NONE, np.int32)
        number[key] = np.arange(len(key), dtype=np.int32)
        of_point = number[place]
        sample = np.empty(len(key), np.int64)
        sample[of_point] = np.arange(len(points))
        return Cells(key, number, of_point, sample)

    def join(self, cells: Cells) -> Int:
        """(C,) cluster of each cell: those that touch at a side or a corner belong together."""
        ahead = np.array([1, self.side - 1, self.side, self.side + 1])
        neighbour = cells.number[cells.key[:, None] + ahead]
        touching = neighbour >= 0
        ends = np.append(0, np.cumsum(touching.sum(axis=1)))
        links = neighbour[touching]
        graph = csr_array((np.ones(len(links)), links, ends), shape=(len(cells), len(cells)))
        cluster: Int = connected_components(graph, directed=False)[1].astype(np.int64)
        return cluster
