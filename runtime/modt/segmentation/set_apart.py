"""Cells of its own for what hangs above people."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from modt.segmentation.cells import Cells
from modt.segmentation.cluster_sizes import ClusterSizes
from modt.segmentation.clusters import Clusters
from modt.segmentation.groups import label_max, label_min
from modt.segmentation.overhang import Overhangs
from modt.types import NONE, Float32, Int


def set_apart(
    found: Clusters, cluster: Int, sizes: ClusterSizes, hanging: Overhangs
) -> tuple[Clusters, Int, ClusterSizes]:
    """The cells, (C,) cluster of each and sizes, after what hangs above people has got cells of its own."""
    cells = np.flatnonzero(hanging.cluster != NONE)
    if not len(cells):
        return found, cluster, sizes
    number = np.full(len(cluster), NONE)
    number[cells] = np.arange(len(cells))
    is_hanging = found.height > hanging.below_m.take(found.cell_of_point)
    point = np.flatnonzero(is_hanging & (number.take(found.cell_of_point) != NONE))
    own = number.take(found.cell_of_point[point])
    entries = np.bincount(own, minlength=len(cells))
    points = sizes.points.copy()
    np.add.at(points, cluster[cells], -entries)
    np.add.at(points, hanging.cluster[cells], entries)
    cell_of_point = found.cell_of_point.copy()
    cell_of_point[point] = len(cluster) + own
    last = np.zeros(len(cells), np.int64)
    np.maximum.at(last, own, point)
    sample = np.concatenate([found.sample, last])
    apart = replace(
        found,
        cell_of_point=cell_of_point,
        cells=_divided(found.cells, cells, hanging.below_m[cells], own, found.height[point]),
        sample=sample,
        sampled=found.points.take(sample),
        air=found.air.followed_by(cells),
    )
    return apart, np.concatenate([cluster, hanging.cluster[cells]]), replace(sizes, points=points)


def _divided(cells: Cells, divided: Int, below_m: Float32, own: Int, height: Float32) -> Cells:
    """All cells, the n divided ones up to (n,) below_m [m], then n cells of the points above.

    Args:
        cells: before.
        divided: (n,) their numbers.
        below_m: (n,) height above which the points get cells of their own [m].
        own: (K,) number of the new cell of each of these points, from 0 on.
        height: (K,) their heights above ground [m].
    """
    n = len(divided)
    entries = np.bincount(own, minlength=n)
    high = cells.high.copy()
    high[divided] = below_m
    remaining = cells.entries.copy()
    remaining[divided] -= entries
    return Cells(
        row=np.concatenate([cells.row, cells.row[divided]]),
        column=np.concatenate([cells.column, cells.column[divided]]),
        levels=np.concatenate([cells.levels, cells.levels[divided]]),
        low=np.concatenate([cells.low, label_min(height, own, n)]),
        high=np.concatenate([high, label_max(height, own, n)]),
        entries=np.concatenate([remaining, entries]),
    )
