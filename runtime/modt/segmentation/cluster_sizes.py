"""Sizes of clusters of cells, G of them while some may be empty."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace

import numpy as np

from modt.segmentation.cells import Cells
from modt.segmentation.grids import PointColumns
from modt.segmentation.groups import label_max, label_min
from modt.types import NONE, Bool, Float32, Int, Self


@dataclass(frozen=True)
class ClusterSizes:
    """Sizes of G clusters, some of them empty."""

    points: Int  # (G,) number of points
    cell: Int  # (G,) last cell of each
    extent_m: Float32  # (G,) diagonal of the axis-parallel rectangle [m]
    bottom_m: Float32  # (G,) least height above ground [m]
    top_m: Float32  # (G,) greatest height above ground [m]
    sqrt_range: Float32  # (G,) square root of the range of the last cell [sqrt(m)]
    beam_m: Float32  # (G,) vertical distance of neighbouring beams there [m]
    of_oversized: Bool  # (G,) part of an oversized cluster; False for a person split off another one

    def __len__(self) -> int:
        return len(self.points)

    @classmethod
    def of_cells(cls, cells: Cells, sampled: PointColumns, beam_m: Float32, cluster: Int) -> Self:
        """Sizes of clusters by (C,) a point of each cell, the distance of beams there [m], its cluster or NONE."""
        n = int(cluster.max(initial=NONE)) + 1
        used = np.flatnonzero(cluster != NONE)
        label = cluster.take(used)
        last = np.zeros(n, np.int64)
        np.maximum.at(last, label, used)
        low = cells.low.take(used)
        high = cells.high.take(used)
        x, y = (column.take(used) for column in (sampled.x, sampled.y))
        width, depth = (label_max(v, label, n) - label_min(v, label, n) for v in (x, y))
        return cls(
            points=np.bincount(label, cells.entries.take(used), n).astype(np.int64),
            cell=last,
            extent_m=np.sqrt(np.square(width) + np.square(depth)),
            bottom_m=label_min(low, label, n),
            top_m=label_max(high, label, n),
            sqrt_range=sampled.sqrt_range.take(last),
            beam_m=beam_m.take(last),
            of_oversized=np.zeros(n, np.bool_),
        )

    def followed_by(self, other: Self) -> Self:
        """These clusters, then the others."""
        pairs = ((getattr(self, f.name), getattr(other, f.name)) for f in fields(self))
        return type(self)(*(np.concatenate(pair) for pair in pairs))

    def merged(self, target: Int) -> ClusterSizes:
        """Sizes after merging each cluster into its (G,) target; those merged into another are empty.

        The extent stays that of the target: merging is limited to the size of an object.
        """
        points = self.points.copy()
        bottom_m = self.bottom_m.copy()
        top_m = self.top_m.copy()
        moved = (target != np.arange(len(target))).nonzero()[0]  # few
        into = target[moved]
        points[moved] = 0
        np.add.at(points, into, self.points[moved])
        np.minimum.at(bottom_m, into, self.bottom_m[moved])
        np.maximum.at(top_m, into, self.top_m[moved])
        return replace(self, points=points, bottom_m=bottom_m, top_m=top_m)


def moved(
    cells: Cells, cluster: Int, sizes: ClusterSizes, part: Int, parts: ClusterSizes, leaves: Bool
) -> tuple[Int, ClusterSizes]:
    """(C,) cluster of each cell, and sizes, after some of the (C,) parts have left their clusters.

    Parts are numbered after the clusters. One that stays keeps its number, with no points. Of a cluster that parts
    leave, only the number of points is corrected. A part may have cells of several clusters.
    """
    in_part = np.flatnonzero(part != NONE)
    moving = in_part[leaves.take(part.take(in_part))]
    gone = np.bincount(cluster.take(moving), cells.entries.take(moving), len(sizes)).astype(np.int64)
    after = cluster.copy()
    after[moving] = len(sizes) + part[moving]
    left = replace(sizes, points=sizes.points - gone)
    return after, left.followed_by(replace(parts, points=parts.points * leaves))
