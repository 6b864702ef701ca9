"""The network's input: a proposal's own points in a frame of their own."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from modt.config import SensorConfig
from modt.types import Float32, Int, Proposals

FOOT_M = 0.3
"""What stands on the ground shows itself from this height on; what is lower went with the ground."""
LEVEL_M, SLOPE = 0.1, 0.02
"""The ground beneath a crop is taken to be within this of the plane the sensor stands on, near by and per range."""


@dataclass(frozen=True, slots=True)
class Crops:
    """Points of some proposals, one after another.

    Attributes:
        xyz: (K, 3) points grouped by proposal [m].
        offsets: (R + 1,) crop i owns xyz[offsets[i]:offsets[i + 1]], never nothing.
    """

    xyz: Float32
    offsets: Int

    def __len__(self) -> int:
        return len(self.offsets) - 1

    @property
    def count(self) -> Int:
        """(R,) points of each crop."""
        return np.diff(self.offsets)

    def padded(self, rows: Int) -> Float32:
        """(len(rows), n, 3) crops of these rows, each filled to the longest by repeating its own points.

        A repeated point changes nothing: the network takes the maximum over points, and max is idempotent.
        """
        count = self.count[rows, None]
        batch: Float32 = self.xyz[self.offsets[rows, None] + np.arange(count.max(initial=1)) % count]
        return batch


def height_of(proposals: Proposals, sensor: SensorConfig) -> float:
    """Of the sensor above the ground [m]: as the proposals say, else as the profile does, else a car's."""
    if proposals.sensor_height_m is not None:
        return proposals.sensor_height_m
    return sensor.height_m or SensorConfig().height_m or 0.0


def gather(points: Float32, proposals: Proposals, which: Int, max_points: int) -> Crops:
    """Points of the proposals given, sensor frame; of a large one every so many-th, the same ones each time.

    Args:
        points: (N, 4) of the frame.
        proposals: its segments.
        which: (R,) those wanted.
        max_points: of one crop.
    """
    own = proposals.count[which]
    kept = np.minimum(own, max_points)
    offsets = np.append(0, np.cumsum(kept))
    step = np.arange(offsets[-1]) - np.repeat(offsets[:-1], kept)
    inside = step * np.repeat(own, kept) // np.repeat(kept, kept)
    members = proposals.members[np.repeat(proposals.offsets[which], kept) + inside]
    return Crops(points[members, :3], offsets)


def canonical(crops: Crops, sensor_height_m: float) -> Crops:
    """Crops as the network sees them: along and across the line of sight from their middle, and above the ground.

    The sensor sees the near side of everything, so a crop turned to the line of sight looks alike from wherever in
    the sweep it comes. The middle is that of its extent, which unlike the mean does not move with the density. The
    ground is where the crop's lowest point says, as far as a gentle slope could have brought it there: near by what
    hangs is seen to hang, far away a rise of the road lifts no car.

    Args:
        crops: points in the sensor frame.
        sensor_height_m: of the sensor above the ground beneath it.
    """
    if not len(crops):
        return crops
    x, y, z = crops.xyz.astype(np.float32).T
    starts, count = crops.offsets[:-1], crops.count
    ahead, left = np.add.reduceat(x, starts) / count, np.add.reduceat(y, starts) / count
    bearing, slack = np.arctan2(left, ahead), LEVEL_M + SLOPE * np.hypot(ahead, left)
    rise = np.clip(np.minimum.reduceat(z, starts) + sensor_height_m - FOOT_M, -slack, slack)
    ground = np.repeat(rise - sensor_height_m, count)
    c, s = np.repeat(np.cos(bearing), count), np.repeat(np.sin(bearing), count)
    along, across = c * x + s * y, c * y - s * x
    return Crops(
        np.stack(
            [along - _middle(along, starts, count), across - _middle(across, starts, count), z - ground],
            axis=1,
            dtype=np.float32,
        ),
        crops.offsets,
    )


def _middle(value: Float32, starts: Int, count: Int) -> Float32:
    low, high = np.minimum.reduceat(value, starts), np.maximum.reduceat(value, starts)
    return np.repeat((low + high) / 2, count)
