"""Input of the network: the points of each proposal in a canonical frame."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from modt.config import SensorConfig
from modt.types import Float32, Float64, Int, Proposals

MAX_PADDING = 100
"""Points of padding that a batch takes on for its next crop; beyond them a further call of the network is cheaper."""
# Definition of the canonical frame: fixed when a model is trained.
_LOWEST_M = 0.3  # height of a standing object's lowest point: what is lower was removed with the ground
_GROUND_OFFSET_M, _GROUND_SLOPE = 0.1, 0.005  # bound on the ground's height beneath a crop: constant, and per range


@dataclass(frozen=True, slots=True)
class Crops:
    """Points of R proposals, one after another."""

    xyz: Float32  # (K, 3) points grouped by proposal [m]
    offsets: Int  # (R + 1,) crop i owns xyz[offsets[i]:offsets[i + 1]], at least one point

    def __len__(self) -> int:
        return len(self.offsets) - 1

    @property
    def count(self) -> Int:
        """(R,) points of each crop."""
        return self.offsets[1:] - self.offsets[:-1]

    def padded(self, rows: Int, least: int = 1) -> Float32:
        """(len(rows), n, 3) crops of these rows, each padded with repetitions of its last point to the largest, or to
        the least n.

        Repeated points leave the output unchanged: the network takes the maximum over points.
        """
        last = self.count[rows, None] - 1
        places = np.minimum(np.arange(last.max(initial=least - 1) + 1), last)
        return self.xyz.take(self.offsets[rows, None] + places, axis=0)


def batches(count: list[int], most: int) -> Iterator[slice]:
    """Batches of crops in ascending order of their numbers of points; `most` crops share one at most."""
    first = 0
    for k in range(1, len(count)):
        if k - first == most or (k - first) * (count[k] - count[k - 1]) > MAX_PADDING:
            yield slice(first, k)
            first = k
    if count:
        yield slice(first, len(count))


def ground_z_m(proposals: Proposals, which: Int | slice, sensor: SensorConfig) -> Float64:
    """(R,) z of the ground beneath proposals [m, sensor frame]: as segmented, else by the height of the sensor."""
    if proposals.ground_z_m is not None:
        return proposals.ground_z_m[which]
    height_m = sensor.height_m or SensorConfig().height_m or 0.0
    return np.full(len(proposals), -height_m)[which]


def gather(proposals: Proposals, which: Int, max_points: int) -> Crops:
    """Points of the given proposals, sensor frame; larger ones evenly subsampled, deterministically.

    Args:
        proposals: proposals of the frame.
        which: (R,) proposals to gather.
        max_points: per crop.
    """
    starts, ends = (proposals.offsets[rows].tolist() for rows in (which, which + 1))
    kept = [proposals.coordinates[:, :0]]
    for first, end in zip(starts, ends, strict=True):  # few: faster than all at once
        own = proposals.coordinates[:, first:end]
        if end - first > max_points:
            own = own.take(np.arange(max_points) * (end - first) // max_points, axis=1)
        kept.append(own)
    return Crops(np.concatenate(kept, axis=1).T, np.array([own.shape[1] for own in kept]).cumsum())


def canonical(crops: Crops, ground_z_m: Float64) -> Crops:
    """Crops in the canonical frame: x along the line of sight, y to its left, z above the ground.

    The sensor sees the near side of an object, so in this frame a crop looks the same at every azimuth. The origin is
    the middle of the extent, which unlike the mean does not depend on the point density. The ground is estimated from
    the lowest point, within a bound that grows with range: a near object above the ground keeps its height, a far
    one on a slope is moved to the ground.

    Args:
        crops: points in the sensor frame.
        ground_z_m: (R,) height of the ground beneath each.
    """
    if not len(crops):
        return crops
    x, y, z = xyz = crops.xyz.T.astype(np.float32, order="C", copy=False)
    starts, count = crops.offsets[:-1], crops.count
    mean_x, mean_y = np.add.reduceat(xyz[:2], starts, axis=1) / count
    azimuth, bound = np.arctan2(mean_y, mean_x), _GROUND_OFFSET_M + _GROUND_SLOPE * np.hypot(mean_x, mean_y)
    rise = (np.minimum.reduceat(z, starts) - ground_z_m - _LOWEST_M).clip(-bound, bound)
    c, s, ground = np.array((np.cos(azimuth), np.sin(azimuth), rise + ground_z_m)).repeat(count, axis=1)
    out = np.array((c * x + s * y, c * y - s * x, z - ground))
    level = out[:2]
    ends = np.minimum.reduceat(level, starts, axis=1) + np.maximum.reduceat(level, starts, axis=1)
    level -= (ends / 2).repeat(count, axis=1)
    return Crops(out.T.astype(np.float32, order="C"), crops.offsets)
