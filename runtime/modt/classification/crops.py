"""Input of the network: the points of each proposal in a canonical frame."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from modt.config import SensorConfig
from modt.types import Float32, Float64, Int, Proposals

# Definition of the canonical frame: fixed when a model is trained.
_LOWEST_M = 0.3
"""Height of a standing object's lowest point [m]: what is lower was removed with the ground."""
_GROUND_OFFSET_M = 0.1
"""Bound on the correction of the ground's height beneath a crop at the sensor [m]."""
_GROUND_SLOPE = 0.005
"""Growth of that bound with the range [m/m]."""


@dataclass(frozen=True)
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

    def select(self, rows: Int) -> Crops:
        """These crops alone."""
        count = self.count[rows]
        offsets = np.append(0, count.cumsum())
        place_in_crop = np.arange(offsets[-1]) - offsets[:-1].repeat(count)
        return Crops(self.xyz.take(self.offsets[rows].repeat(count) + place_in_crop, axis=0), offsets)

    def padded(self, rows: Int, min_points: int = 1) -> Float32:
        """(R, n, 3) crops of these (R,) rows, each padded by its last point to the largest of them or to min_points.

        Repeated points leave the output unchanged: the network takes the maximum over points.
        """
        last = self.count[rows, None] - 1
        places = np.minimum(np.arange(last.max(initial=min_points - 1) + 1), last)
        return self.xyz.take(self.offsets[rows, None] + places, axis=0)


def batches(count: list[int], max_crops: int, max_padding_points: int) -> Iterator[slice]:
    """Slices of the crops that share a call of the network.

    A batch ends where its next crop would pad those before it by more than so many points in all: a further call is
    cheaper.

    Args:
        count: points of each crop, ascending.
        max_crops: crops of a batch at most.
        max_padding_points: points of padding at most that a batch takes on for its next crop.
    """
    first = 0
    for crop in range(1, len(count)):
        n_crops = crop - first
        if n_crops == max_crops or n_crops * (count[crop] - count[crop - 1]) > max_padding_points:
            yield slice(first, crop)
            first = crop
    if count:
        yield slice(first, len(count))


def ground_z_m(proposals: Proposals, which: Int | slice, sensor: SensorConfig) -> Float64:
    """(R,) z of the ground beneath the (R,) proposals [m, sensor frame]: as segmented, else by `sensor`."""
    if proposals.ground_z_m is not None:
        return proposals.ground_z_m[which]
    height_m = sensor.height_m or SensorConfig().height_m or 0.0
    return np.full(len(proposals), -height_m)[which]


def gather(proposals: Proposals, which: Int, max_points: int) -> Crops:
    """Points of the given proposals in the sensor frame. Every n-th point of a larger proposal is kept.

    Args:
        proposals: proposals of the frame.
        which: (R,) proposals to gather.
        max_points: points of a crop at most.
    """
    starts = proposals.offsets[which].tolist()
    ends = proposals.offsets[which + 1].tolist()
    gathered = [proposals.coordinates[:, :0]]  # the first offset is 0
    for first, end in zip(starts, ends, strict=True):  # few: faster than all at once
        points = proposals.coordinates[:, first:end]
        if end - first > max_points:
            points = points.take(np.arange(max_points) * (end - first) // max_points, axis=1)
        gathered.append(points)
    return Crops(np.concatenate(gathered, axis=1).T, np.array([points.shape[1] for points in gathered]).cumsum())


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
    starts = crops.offsets[:-1]
    count = crops.count
    xyz = crops.xyz.T.astype(np.float32, order="C", copy=False)
    x, y, z = xyz
    mean_x, mean_y = np.add.reduceat(xyz[:2], starts, axis=1) / count
    azimuth = np.arctan2(mean_y, mean_x)
    bound = _GROUND_OFFSET_M + _GROUND_SLOPE * np.hypot(mean_x, mean_y)
    rise = (np.minimum.reduceat(z, starts) - ground_z_m - _LOWEST_M).clip(-bound, bound)
    # From here on one value a point: cosine and sine of its crop's azimuth, and the ground beneath it.
    c, s, ground = np.array((np.cos(azimuth), np.sin(azimuth), rise + ground_z_m)).repeat(count, axis=1)
    turned = np.array((c * x + s * y, c * y - s * x, z - ground))
    level = turned[:2]
    ends = np.minimum.reduceat(level, starts, axis=1) + np.maximum.reduceat(level, starts, axis=1)
    level -= (ends / 2).repeat(count, axis=1)
    return Crops(turned.T.astype(np.float32, order="C"), crops.offsets)
