"""k-DOPs: extents of point sets in eight directions of the ground plane (discrete oriented polytopes, k = 8).

A k-DOP is eight numbers: the greatest coordinate of its points along each of DIRECTIONS. Opposite directions are
four apart: the ends along axis k are at kdop[k] and at -kdop[k + 4]. The k-DOP of a union is the maximum of both.
Many are an (8, n) array, a contiguous row a direction.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from modt.types import Bool, Float32, Float64, Int, Proposals

Ends = Callable[[Float32, Int, Float32], Float32]

_BEARINGS_RAD = np.deg2rad([0.0, 45.0, 90.0, 135.0])
AXES = np.stack([np.cos(_BEARINGS_RAD), np.sin(_BEARINGS_RAD)])
"""(2, 4) unit vectors of the axes, world frame."""
DIRECTIONS = np.concatenate([AXES, -AXES], axis=1)
"""(2, 8) the directions: each axis forth, then each axis back."""
_PAD_M = 0.15
"""Jitter of the ends of k-DOPs."""


def kdop_ends(xyz: Float32, offsets: Int, axes: Float32) -> Float32:
    """(8, G) greatest coordinates of groups of points along axes, then against them.

    Args:
        xyz: (3, K) points sorted by group [m].
        offsets: (G + 1,) group i owns the columns from offsets[i] to offsets[i + 1]; none is empty.
        axes: (3, 4) unit vectors.
    """
    along = axes[0][:, None] * xyz[0]
    along += axes[1][:, None] * xyz[1]
    along += axes[2][:, None] * xyz[2]
    ahead, behind = (f.reduceat(along, offsets[:-1], axis=1) for f in (np.maximum, np.minimum))
    return np.concatenate([ahead, -behind])


def kdops(proposals: Proposals, T_world_sensor: Float64, ends: Ends = kdop_ends) -> Float64:
    """(8, P) k-DOPs of the proposals in the world [m]; `ends` is `kdop_ends`, or what does the same."""
    if not len(proposals):
        return np.zeros((8, 0))
    axes = np.ascontiguousarray(T_world_sensor[:2, :3].T @ AXES, np.float32)
    reach: Float64 = (
        ends(proposals.coordinates, proposals.offsets, axes) + (T_world_sensor[:2, 3] @ DIRECTIONS)[:, None]
    )
    return reach


def widths(kdop: Float64) -> Float64:
    """(4, n) from end to end along each axis, of (8, n) k-DOPs [m]."""
    width: Float64 = kdop[:4] + kdop[4:]
    return width


def centres(kdop: Float64) -> Float64:
    """(4, n) middle along each axis, of (8, n) k-DOPs [m]."""
    centre: Float64 = (kdop[:4] - kdop[4:]) / 2
    return centre


def coverage(kdop: Float64, other: Float64) -> Float64:
    """(n,) part of each k-DOP (8, n) that the other (8, n) covers: the lesser for the two rectangles around it."""
    common = np.maximum(widths(np.minimum(kdop, other + _PAD_M)), 0.0)
    part = common / np.maximum(widths(kdop), _PAD_M)
    least: Float64 = np.minimum(part[0] * part[2], part[1] * part[3])
    return least


def overlapping_pairs(a: Float64, b: Float64) -> tuple[Int, Int]:
    """Pairs, in order, of k-DOPs a (8, n) and b (8, k) that overlap along x and along y: two arrays of indices."""
    near: Bool = a[0][:, None] >= -b[4]
    for side in (2, 4, 6):
        near &= a[side][:, None] >= -b[side - 4]
    pair = near.ravel().nonzero()[0]
    one = pair // near.shape[1]
    return one, pair - one * near.shape[1]
