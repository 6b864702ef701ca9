"""Clusters of cells, and points by cluster."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from modt.segmentation.cells import AirOfCells, Cells
from modt.segmentation.grids import PointColumns
from modt.segmentation.groups import Groups, consecutive
from modt.types import NONE, Bool, Float32, Int, Int8, PointKind


@dataclass(frozen=True)
class Clusters:
    """K points above ground in C cells, and cells in n clusters."""

    points: PointColumns
    height: Float32  # (K,) above ground [m]
    cell_of_point: Int  # (K,)
    cells: Cells
    sample: Int  # (C,) last point of each cell
    sampled: PointColumns  # (C,) that point
    cluster_of_cell: Int  # (C,) NONE where it cannot be an object
    kind_of_cell: Int8  # (C,) PointKind of its points, MEMBER of a cluster
    n: int
    air: AirOfCells

    def select(self, keep: Bool, kind: PointKind) -> Clusters:
        """The clusters of an (n,) mask, renumbered; the points of the others are of a kind."""
        if keep.all():
            return self
        clustered = np.flatnonzero(self.cluster_of_cell != NONE)
        cluster_of_cell = np.full(len(self.cells), NONE)
        cluster_of_cell[clustered] = consecutive(keep)[self.cluster_of_cell[clustered]]
        dropped = clustered[cluster_of_cell[clustered] == NONE]
        kind_of_cell = self.kind_of_cell.copy()
        kind_of_cell[dropped] = kind
        return replace(self, cluster_of_cell=cluster_of_cell, kind_of_cell=kind_of_cell, n=int(keep.sum()))


@dataclass(frozen=True)
class Members:
    """M points by cluster, in the order of the sweep within a cluster."""

    offsets: Int  # (n + 1,) cluster i has the points from offsets[i] to offsets[i + 1]
    index: Int  # (M,) rows of the sweep
    columns: Float32  # (4, M) x, y, z, and z of the ground beneath [m, sensor frame]


def members_of(
    tall: Clusters, low: Clusters, places: Int, points: PointColumns, height: Float32, index: Int, kind: Int8
) -> Members:
    """Points of each tall cluster, then of each low one.

    Args:
        tall: clusters of the first K points.
        low: clusters of the points at (P,) places; of these they replace the tall ones.
        places: (P,) those places.
        points: (K + L,) points.
        height: (K + L,) their heights above ground [m].
        index: (K + L,) row of each in the sweep.
        kind: (N,) PointKind of all points of the sweep, into which those of the points go.
    """
    cluster = np.full(len(index), NONE)
    # Tall clusters come first, so that the low ones replace them where both have a point.
    for first, at, clusters in ((0, np.arange(len(tall.cell_of_point)), tall), (tall.n, places, low)):
        kind[index[at]] = clusters.kind_of_cell.take(clusters.cell_of_point)
        of_cell = np.where(clusters.cluster_of_cell == NONE, NONE, clusters.cluster_of_cell + first)
        cluster[at] = of_cell.take(clusters.cell_of_point)
    groups = Groups.from_labels(cluster, tall.n + low.n)
    x, y, z, height = (v.take(groups.rows) for v in (points.x, points.y, points.z, height))
    return Members(groups.offsets, index.take(groups.rows), np.stack([x, y, z, z - height]))
