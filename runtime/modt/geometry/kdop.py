"""k-DOPs: extents of point sets in eight directions of the ground plane (discrete oriented polytopes, k = 8).

A k-DOP is eight numbers: the greatest coordinate of its points along each of DIRECTIONS. Opposite directions are
four apart: the ends along axis k are at kdop[k] and at -kdop[k + 4]. The k-DOP of a union is the maximum of both.
Many are an (8, n) array, a contiguous row a direction.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from modt.types import Bool, Float32, Float64, Int, Int16, Proposals

Ends = Callable[[Float32, Int, Float32], Float32]
Reaching = Callable[[Int16 | Float64, Int16 | Float64], tuple[Int, Int]]

_BEARINGS_RAD = np.deg2rad([0.0, 45.0, 90.0, 135.0])
AXES = np.stack([np.cos(_BEARINGS_RAD), np.sin(_BEARINGS_RAD)])
"""(2, 4) unit vectors of the axes, world frame."""
DIRECTIONS = np.concatenate([AXES, -AXES], axis=1)
"""(2, 8) the directions: each axis forth, then each axis back."""
_PAD_M = 0.15
"""Jitter of the ends of k-DOPs."""
_CELL_M, _FARTHEST = 0.02, 2**15 - 1
"""Many k-DOPs are compared in whole cells: 16 bits are compared twice as fast as 32."""
_FEW_PAIRS = 4_000
"""Up to so many pairs, exact comparison costs less than cells."""


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


def reaching_pairs(ends: Int16 | Float64, opposite: Int16 | Float64) -> tuple[Int, Int]:
    """Pairs, in order, of which ends (4, n) reach the opposite ends (4, k), two rows on, on every side."""
    near: Bool = ends[0][:, None] >= opposite[2]
    for side in (1, 2, 3):
        near &= ends[side][:, None] >= opposite[side - 2]
    pair = near.ravel().nonzero()[0]
    one = pair // near.shape[1]
    return one, pair - one * near.shape[1]


def overlapping_pairs(a: Float64, b: Float64, reaching: Reaching = reaching_pairs) -> tuple[Int, Int]:
    """Pairs of k-DOPs a (8, n) and b (8, k) that overlap along x and along y: two arrays of indices, in order.

    Of many, pairs less than a cell of 2 cm apart may count as overlapping, and so may all that lie more than 655 m
    from the first of b, on the same side. k-DOPs b are finite; an infinitely small one of a overlaps nothing.
    `reaching` is `reaching_pairs`, or what does the same.
    """
    if a.shape[1] * b.shape[1] <= _FEW_PAIRS:
        return reaching(a[::2], -b[::2])
    origin = (b[:4:2, 0] @ DIRECTIONS[:, ::2])[:, None]
    return reaching(_cells(a[::2] - origin), _cells(-b[::2] + origin))


def _cells(coordinate: Float64) -> Int16:
    """Coordinates about the same origin [m], in cells."""
    return np.minimum(np.maximum(coordinate / _CELL_M, -_FARTHEST), _FARTHEST).astype(np.int16)
