"""What a frame's proposals show, in the world."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from modt.geometry import transform, transform_boxes
from modt.types import Bool, Float32, Float64, Frame, Int, Proposals

DIRECTIONS = np.deg2rad([0.0, 45.0, 90.0, 135.0])
"""Bearings of the axes along which an outline is measured, world frame [rad]."""
PAD_M = 0.15
"""Outlines jitter by this much."""
FEW_PAIRS = 200_000
"""Up to this many, looking at every pair costs less than sorting."""
AXES = np.stack([np.cos(DIRECTIONS), np.sin(DIRECTIONS)])


@dataclass(frozen=True, slots=True)
class Sightings:
    """The proposals of a frame in the world; P rows.

    Attributes:
        box: (P, 7) world frame.
        centroid: (P, 2) mean of the points [m].
        low, high: (P, 4) outline: least and greatest coordinate of the points along each of AXES [m].
        foot, top: (P,) heights of the lowest and the highest point [m].
        count: (P,) points.
        range_m: (P,) distance from the sensor.
        cut: (P,) the outline is cut short by the field of view or by something in front.
        eye: (2,) where the sensor stands [m].
    """

    box: Float64
    centroid: Float64
    low: Float64
    high: Float64
    foot: Float64
    top: Float64
    count: Int
    range_m: Float64
    cut: Bool
    eye: Float64

    def __len__(self) -> int:
        return len(self.box)

    @property
    def place(self) -> Float64:
        """(P, 2) middle of the outline along x and y [m]."""
        middle: Float64 = (self.low[:, [0, 2]] + self.high[:, [0, 2]]) / 2
        return middle


def sight(frame: Frame, proposals: Proposals, T_world_sensor: Float64) -> Sightings:
    """The proposals of a frame, taken to the world by T_world_sensor (4, 4)."""
    low, high = outlines(proposals, T_world_sensor)
    box = transform_boxes(T_world_sensor, proposals.box)
    return Sightings(
        box=box,
        centroid=transform(T_world_sensor, proposals.centroid)[:, :2],
        low=low,
        high=high,
        foot=box[:, 2] - box[:, 5] / 2,
        top=box[:, 2] + box[:, 5] / 2,
        count=proposals.count,
        range_m=np.hypot(proposals.centroid[:, 0], proposals.centroid[:, 1]),
        cut=proposals.truncated | proposals.occluded,
        eye=T_world_sensor[:2, 3],
    )


def touching(low_a: Float64, high_a: Float64, low_b: Float64, high_b: Float64) -> tuple[Int, Int]:
    """Pairs of outlines (n, 4) and (k, 4) that overlap along x and along y, as two arrays of indices, in order."""
    ends = (np.ascontiguousarray(a[:, ::2].T, np.float32) for a in (low_a, high_a, low_b, high_b))
    find = compare_all if len(low_a) * len(low_b) < FEW_PAIRS else sweep
    pair = find(*ends)
    i, j = np.divmod(pair, max(len(low_b), 1))
    return i, j


def compare_all(low_a: Float32, high_a: Float32, low_b: Float32, high_b: Float32) -> Int:
    """Pairs i * k + j, in order, of intervals (2, n) and (2, k) that overlap along both axes, all looked at."""
    near = low_a[0][:, None] <= high_b[0]
    near &= high_a[0][:, None] >= low_b[0]
    near &= low_a[1][:, None] <= high_b[1]
    near &= high_a[1][:, None] >= low_b[1]
    return np.flatnonzero(near)


def sweep(low_a: Float32, high_a: Float32, low_b: Float32, high_b: Float32) -> Int:
    """The same pairs: sorted along the first axis, those that can overlap an interval are a stretch of the others.

    It ends where they begin beyond the interval, and begins where the first of them reaches it.
    """
    order = low_b[0].argsort()
    low_b, high_b = low_b.take(order, axis=1), high_b.take(order, axis=1)
    first = np.maximum.accumulate(high_b[0]).searchsorted(low_a[0])
    n = np.maximum(low_b[0].searchsorted(high_a[0], side="right") - first, 0)
    i = np.repeat(np.arange(len(n)), n)
    j = np.arange(len(i)) + np.repeat(first + n - np.cumsum(n), n)
    near = (low_a[1].take(i) <= high_b[1].take(j)) & (high_a[1].take(i) >= low_b[1].take(j))
    near &= low_a[0].take(i) <= high_b[0].take(j)  # the first reaches it, not all that come after
    pair: Int = i[near] * len(order) + order[j[near]]
    pair.sort()
    return pair


def covered(low: Float64, high: Float64, low_place: Float64, high_place: Float64) -> Float64:
    """(k,) part of each outline (k, 4) within its place (k, 4): the lesser for the two squares that hold them."""
    common = np.minimum(high, high_place + PAD_M) - np.maximum(low, low_place - PAD_M)
    part = np.maximum(common, 0.0) / np.maximum(high - low, PAD_M)
    least: Float64 = np.minimum(part[:, 0] * part[:, 2], part[:, 1] * part[:, 3])
    return least


def girth(low: Float64, high: Float64) -> Float64:
    """(k,) sum of the four lengths of each outline (k, 4) [m]."""
    length = (high - low).T
    total: Float64 = length[0] + length[1] + length[2] + length[3]  # a reduction of so short an axis is slow
    return total


def outlines(proposals: Proposals, T_world_sensor: Float64) -> tuple[Float64, Float64]:
    """(P, 4) least and (P, 4) greatest coordinate of each proposal's points along AXES, world frame [m]."""
    n = len(proposals)
    if not n:
        return np.zeros((0, 4)), np.zeros((0, 4))
    R = T_world_sensor[:2, :3, None].astype(np.float32)
    x, y, z = proposals.coordinates
    xy = R[:, 0] * x
    term = np.empty_like(xy)  # tens of thousands of points: every array less is less that leaves the cache
    xy += np.multiply(R[:, 1], y, out=term)
    xy += np.multiply(R[:, 2], z, out=term)
    x, y = xy
    one, half = np.float32(1.0), np.float32(np.sqrt(0.5))
    axes = ((x, one), (np.add(x, y, out=term[0]), half), (y, one), (np.subtract(y, x, out=term[1]), half))
    starts = proposals.offsets[:-1]
    low, high = np.empty((n, 4)), np.empty((n, 4))
    for k, (along, scale) in enumerate(axes):
        low[:, k] = scale * np.minimum.reduceat(along, starts)
        high[:, k] = scale * np.maximum.reduceat(along, starts)
    shift = T_world_sensor[:2, 3] @ AXES
    return low + shift, high + shift
