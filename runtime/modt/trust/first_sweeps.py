"""Checks of the first sweeps of a source, without any history."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import pairwise

import numpy as np

from modt.config import SensorConfig
from modt.trust.returns import sides
from modt.trust.sample import SECTORS, part_of_turn, turn_of
from modt.types import Float32

FEW_SHARE = 0.15
"""Share of the returns that beams and steps of a profile make below which a sweep has too few."""
EMPTY_SECTORS = 4
"""Number of sectors without returns from which a part of the view is missing."""
ONE_RING = 0.03
"""Width of the tangents of the elevations within which nine tenths of a sweep are one ring."""
NEAR_M = 8.0
"""Range within which nine tenths of the returns lie in fog, in dust, or in a small room [m]."""


def doubts(sweeps: Sequence[Float32], sensor: SensorConfig) -> Iterator[tuple[bool, str, str]]:
    """Each doubt about sweeps of (N, 4) points: whether it makes results useless, a phrase for it, and its remedy."""
    if len(sweeps) > 1 and any(np.array_equal(a[:, :3], b[:, :3]) for a, b in pairwise(sweeps)):
        yield True, "the same sweep comes again and again", "restart the sensor and its driver"
    points = sweeps[-1]
    range_m = np.hypot(points[:, 0], points[:, 1])
    seen = (range_m > 0) & (range_m < sensor.max_range_m)
    points = points[seen]
    range_m = range_m[seen]
    expected = sensor.rays_per_turn
    if len(points) < FEW_SHARE * expected:
        yield True, f"{len(points)} returns of about {expected:.0f}", "uncover and clean the sensor"
    if not len(points):
        return
    x, y, z, _ = points.T
    sector = part_of_turn(turn_of(x, y), SECTORS)
    empty = np.bincount(sector, minlength=SECTORS) == 0
    if np.count_nonzero(empty) >= EMPTY_SECTORS:
        what = f"no returns from {sides(empty)} ({360 // SECTORS * np.count_nonzero(empty)} deg)"
        yield False, what, "uncover the sensor, if its field of view is meant to be wider"
    low, high = np.quantile(z / range_m, (0.05, 0.95)).tolist()
    if high - low < ONE_RING:
        yield True, "all returns are at one elevation, as of one beam", "check the sensor, or its driver"
    reach_m = float(np.quantile(range_m, 0.9))
    if reach_m < NEAR_M:
        yield False, f"nine tenths of the returns are within {reach_m:.1f} m", "look for fog, dust or a cover"
