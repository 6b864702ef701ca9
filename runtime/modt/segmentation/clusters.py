"""Euclidean clusters: connected occupied cells of a bird's-eye grid."""

from __future__ import annotations

import numpy as np
from scipy import ndimage

from modt.types import Float32, Int


def connected(xy: Float32, cell_m: float, reach_m: float) -> tuple[Int, int]:
    """Cluster of each point, and how many there are.

    Args:
        xy: (K, 2) bird's-eye coordinates within reach_m of the origin [m].
        cell_m: points in touching cells of this size belong together [m].
        reach_m: half the side of the grid [m].
    """
    side = int(np.ceil(2 * reach_m / cell_m)) + 1
    ij = ((xy + np.float32(reach_m)) * np.float32(1 / cell_m)).astype(np.int32)
    occupied = np.zeros((side, side), np.bool_)
    occupied[ij[:, 0], ij[:, 1]] = True
    labels, n = ndimage.label(occupied, structure=np.ones((3, 3)))
    return labels[ij[:, 0], ij[:, 1]].astype(np.int64) - 1, int(n)
