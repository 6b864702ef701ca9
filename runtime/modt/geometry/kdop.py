"""Outlines: how far points reach in eight directions, bird's-eye view.

An outline is eight numbers: the greatest coordinate of its points along each of DIRECTIONS. What lies opposite is
four further on, so the ends along axis k are at outline[k] and at -outline[k + 4]. As all eight say how far something
reaches, the outline of two things together is the greater of theirs in each direction, and both ends of an axis are
treated alike. Many are an (8, n) array, a contiguous row a direction: arithmetic along an axis of eight is slow.
"""

from __future__ import annotations

import numpy as np

from modt.types import Bool, Float64, Int, Int16, Proposals

AXIS_BEARINGS_RAD = np.deg2rad([0.0, 45.0, 90.0, 135.0])
"""Bearings of the axes along which an outline is measured, world frame [rad]."""
AXES = np.stack([np.cos(AXIS_BEARINGS_RAD), np.sin(AXIS_BEARINGS_RAD)])
"""(2, 4) their unit vectors."""
DIRECTIONS = np.concatenate([AXES, -AXES], axis=1)
"""(2, 8) the directions: each axis forth, then each axis back."""
PAD_M = 0.15
"""Outlines jitter by this much."""
CELL_M, FAR = 0.02, 2**15 - 1
"""Where outlines touch is looked for in whole cells up to so many away: 16 bits are compared twice as fast as 32."""
HANDFUL, FEW_PAIRS = 4_000, 400_000
"""Up to so many pairs, looking at every one of them costs less than cells, and then than sorting."""


def kdops(proposals: Proposals, T_world_sensor: Float64) -> Float64:
    """(8, P) outlines of the proposals in the world [m]."""
    n = len(proposals)
    if not n:
        return np.zeros((8, 0))
    along = (AXES.T @ T_world_sensor[:2, :3]).astype(np.float32) @ proposals.coordinates
    starts = proposals.offsets[:-1]
    ahead, behind = np.maximum.reduceat(along, starts, axis=1), np.minimum.reduceat(along, starts, axis=1)
    reach: Float64 = np.concatenate([ahead, -behind]) + (T_world_sensor[:2, 3] @ DIRECTIONS)[:, None]
    return reach


def widths(kdop: Float64) -> Float64:
    """(4, n) from end to end of each outline (8, n) along each axis [m]."""
    length: Float64 = kdop[:4] + kdop[4:]
    return length


def width_sum(kdop: Float64) -> Float64:
    """(n,) sum of the four lengths of each outline (8, n) [m]."""
    total: Float64 = widths(kdop).sum(axis=0)
    return total


def centres(kdop: Float64) -> Float64:
    """(4, n) middle of each outline (8, n) along each axis [m]."""
    middle: Float64 = (kdop[:4] - kdop[4:]) / 2
    return middle


def coverage(kdop: Float64, position: Float64) -> Float64:
    """(n,) part of each outline (8, n) within its place (8, n): the lesser for the two squares that hold them."""
    common = np.maximum(widths(np.minimum(kdop, position + PAD_M)), 0.0)
    part = common / np.maximum(widths(kdop), PAD_M)
    least: Float64 = np.minimum(part[0] * part[2], part[1] * part[3])
    return least


def overlapping_pairs(a: Float64, b: Float64) -> tuple[Int, Int]:
    """Pairs of outlines a (8, n) and b (8, k) that overlap along x and along y: two arrays of indices, in order.

    Of many, what is less than CELL_M apart may count as touching, and so may all that lies more than FAR cells away
    from the first of b, on the same side. Outlines b are finite; those of a that never saw anything touch nothing.
    """
    n, k = a.shape[1], b.shape[1]
    if n * k <= HANDFUL:
        pair = compare_all(a[::2], -b[::2])
    else:
        origin = (b[:4:2, 0] @ DIRECTIONS[:, ::2])[:, None]
        ends, facing = _cells(a[::2] - origin), _cells(-b[::2] + origin)
        pair = (compare_all if n * k < FEW_PAIRS else sweep)(ends, facing)
    i = pair // k
    return i, pair - i * k


def _cells(coordinate: Float64) -> Int16:
    """Coordinates about the same origin [m], in cells of CELL_M."""
    return np.minimum(np.maximum(coordinate / CELL_M, -FAR), FAR).astype(np.int16)


def compare_all(ends: Int16 | Float64, facing: Int16 | Float64) -> Int:
    """Pairs i * k + j, in order, of which ends (4, n) reach what faces them (4, k) on every side, all looked at.

    What faces an end is the other's opposite one, two further on and with its sign reversed.
    """
    near: Bool = ends[0][:, None] >= facing[2]
    for side in (1, 2, 3):
        near &= ends[side][:, None] >= facing[side - 2]
    return near.ravel().nonzero()[0]


def sweep(ends: Int16, facing: Int16) -> Int:
    """The same pairs: sorted along the first axis, those that can overlap an interval are a stretch of the others.

    It ends where they begin beyond the interval, and begins where the first of them reaches it.
    """
    order = facing[2].argsort()
    facing = facing.take(order, axis=1)
    first = np.maximum.accumulate(-facing[0]).searchsorted(-ends[2])
    n = np.maximum(facing[2].searchsorted(ends[0], side="right") - first, 0)
    i = np.repeat(np.arange(len(n)), n)
    j = np.arange(len(i)) + np.repeat(first + n - np.cumsum(n), n)
    near = (ends[1].take(i) >= facing[3].take(j)) & (ends[3].take(i) >= facing[1].take(j))
    near &= ends[2].take(i) >= facing[0].take(j)  # the first reaches it, not all that come after
    pair: Int = i[near] * len(order) + order[j[near]]
    pair.sort()
    return pair
