"""The ceiling of a room that lies within the height of what can be an object."""

from __future__ import annotations

import numpy as np

from modt.config.segmentation import CeilingConfig
from modt.types import Float32


def below_ceiling_m(height: Float32, config: CeilingConfig) -> float | None:
    """Height [m] up to which objects reach under a ceiling, by (K,) heights of returns above ground; None outdoors.

    Most of the returns above people's heads are at one height there; on walls, trees and houses they spread.
    """
    upper = height[height > np.float32(config.above_m)]
    if len(upper) < config.min_returns:
        return None
    count = np.bincount(
        ((upper - np.float32(config.above_m)) / np.float32(config.bin_m)).astype(np.int64), minlength=2
    )
    pair = count[:-1] + count[1:]
    pair[: round((config.lowest_m - config.above_m) / config.bin_m)] = 0  # doors
    first = int(pair.argmax())
    if pair[first] < config.min_share * len(upper):
        return None
    begins = first - 1 if first and count[first - 1] > config.edge_share * pair[first] else first
    return config.above_m + config.bin_m * begins - config.clearance_m
