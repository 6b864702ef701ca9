"""Clusters of cells, and sizes of clusters."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from typing import Self

import numpy as np

from modt.segmentation.cells import Cells
from modt.segmentation.groups import consecutive, label_max, label_min
from modt.segmentation.point_columns import PointColumns
from modt.types import NONE, Bool, Float32, Int


@dataclass(frozen=True, slots=True)
class ClusterSizes:
    """Sizes of G clusters, some of them empty."""

    points: Int  # (G,) number of points
    extent_m: Float32  # (G,) diagonal of the axis-parallel rectangle [m], infinite where empty
    bottom_m: Float32  # (G,) least height above ground [m]
    top_m: Float32  # (G,) greatest height above ground [m]
    sqrt_range: Float32  # (G,) square root of the range of one cell [sqrt(m)]
    beam_m: Float32  # (G,) vertical distance of neighbouring beams at that cell [m]
    is_part: Bool  # (G,) part of an oversized cluster

    def __len__(self) -> int:
        return len(self.points)

    @classmethod
    def of_cells(cls, cells: Cells, points: PointColumns, count: Int, beam_m: Float32, cluster: Int) -> Self:
        """Sizes of the clusters of (C,) cells.

        Args:
            cells: of all clusters.
            points: (C,) one of each cell.
            count: (C,) points of each cell.
            beam_m: (C,) vertical distance of neighbouring beams there [m].
            cluster: (C,) cluster of each cell.
        """
        extent_m = diagonals(points.x, points.y, cluster)
        n = len(extent_m)
        one_cell = np.zeros(n, np.int64)
        one_cell[cluster] = np.arange(len(cluster))
        return cls(
            points=np.bincount(cluster, count, n).astype(np.int64),
            extent_m=extent_m,
            bottom_m=label_min(cells.low, cluster, n),
            top_m=label_max(cells.high, cluster, n),
            sqrt_range=points.sqrt_range.take(one_cell),
            beam_m=beam_m.take(one_cell),
            is_part=np.zeros(n, np.bool_),
        )

    def followed_by(self, other: Self) -> Self:
        """These clusters, then the others."""
        pairs = ((getattr(self, f.name), getattr(other, f.name)) for f in fields(self))
        return type(self)(*(np.concatenate(pair) for pair in pairs))

    def merged(self, target: Int) -> ClusterSizes:
        """Sizes after merging each cluster into its (G,) target; those merged into another are empty.

        The extent stays that of the target: merging is limited to the size of an object.
        """
        n = len(self)
        points = np.bincount(target, self.points, n).astype(np.int64)
        bottom_m, top_m = label_min(self.bottom_m, target, n), label_max(self.top_m, target, n)
        return replace(self, points=points, bottom_m=bottom_m, top_m=top_m)


@dataclass(frozen=True, slots=True)
class Clusters:
    """K points above ground in C cells, and cells in n clusters."""

    points: PointColumns
    height: Float32  # (K,) above ground [m]
    cell: Int  # (K,) cell of each point
    cells: Cells
    sample: Int  # (C,) last point of each cell
    of_cell: Int  # (C,) cluster of each cell, NONE where it cannot be an object
    n: int

    def select(self, keep: Bool) -> Clusters:
        """The clusters of an (n,) mask, renumbered."""
        if keep.all():
            return self
        number = np.append(consecutive(keep), NONE)  # the last entry is that of NONE
        return replace(self, of_cell=number[self.of_cell], n=int(keep.sum()))


def diagonals(x: Float32, y: Float32, labels: Int) -> Float32:
    """(G,) diagonal of the axis-parallel rectangle around the points of each label, infinite without any [m]."""
    n = int(labels.max(initial=NONE)) + 1
    diagonal: Float32 = np.hypot(*(label_max(v, labels, n) - label_min(v, labels, n) for v in (x, y)))
    return diagonal
