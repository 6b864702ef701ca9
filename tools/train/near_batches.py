"""Batches of near crops: simulated ones, and crops of the streets as a low sensor would see them."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.random import Generator

from modt import profile
from modt.classes import N_CLASSES
from modt.classification.crops import Crops
from modt.config import SegmentationConfig
from modt.segmentation.view_ends import ViewEnds
from modt.types import Cut, Float64, Int
from modt_simulation.sensors import SENSORS
from modt_training.augment import distance_m, subsample
from modt_training.dataset import SYNTHETIC, Dataset, Pools, Sensors, draw_batch
from tools.train.mounts import MIN_RANGE_M
from tools.train.near_scans import HEIGHT_M, RANGE_M

SHARE = np.array([0.5, 0.08, 0.38, 0.04])
"""Shares of the classes in a batch."""
NEAR_BATCH = 72
"""Simulated crops of a batch."""
CUT_BATCH = 40
"""Crops of the streets in a batch that are cut near; some show too little and are left out."""
CUT_RANGE_M = 25.0
"""Greatest distance of a crop of the streets that is cut near."""
CUT_POINTS = 60
"""Least number of points of a crop of the streets that is cut near."""
MAX_POINTS = 800
"""Points used of a crop of the streets that is cut near, at most."""
HIDDEN_SHARE = 0.2
"""Share of the crops that are hidden at a side."""
MAX_HIDDEN = 0.45
"""Greatest share of the width of a crop that is hidden."""
MIN_POINTS = 8
"""Points of a hidden crop that must be left, else it stays whole."""
MAX_HEIGHT_M = SegmentationConfig().max_height_m
MIN_CUT_POINTS = 20
"""A crop with fewer points between the beams is left out."""
LOG_RANGE = math.log(RANGE_M[0]), math.log(RANGE_M[1])
SPANS: Float64 = np.tan(np.deg2rad([s for s in (profile.load(n).sensor.span_deg for n in SENSORS) if s is not None]))
"""(S, 2) rise over distance of the lowest and the highest beam, sensor by sensor."""


@dataclass(frozen=True)
class NearBatch:
    """R near crops, the sensors that measured them, (R,) labels and (R,) flags of Cut."""

    crops: Crops
    sensors: Sensors
    label: Int
    cut: Int


class NearSource:
    """Draws near crops.

    Args:
        near: crops of worlds of the kind "near".
        streets: crops of the streets; real ones that show enough are cut near.
    """

    def __init__(self, near: Dataset, streets: Dataset) -> None:
        self._near = near
        self._streets = streets
        self._flags = cut_flags(near)
        self._pools = _by_class(near, np.flatnonzero(near.trainable))
        shown = streets.trainable & (distance_m(streets.crops) < CUT_RANGE_M) & (streets.crops.count >= CUT_POINTS)
        real = streets.variant != SYNTHETIC
        self._cuttable = _by_class(streets, np.flatnonzero(shown & (real | ~real.any())))

    def draw(self, rng: Generator) -> NearBatch:
        """Draw a batch."""
        rows = draw_batch(self._pools, rng, NEAR_BATCH, SHARE)
        street = draw_batch(self._cuttable, rng, CUT_BATCH, SHARE)
        simulated, side = varied(self._near.take(rows), rng)
        crops = subsample(self._streets.take(street), MAX_POINTS, rng)
        crops, sensors, kept, flags = cut_near(crops, self._streets.sensors.take(street), rng)
        crops, street_side = varied(crops, rng)
        return NearBatch(
            _joined(simulated, crops),
            self._near.sensors.take(rows).followed_by(sensors),
            np.concatenate([self._near.label[rows], self._streets.label[street[kept]]]),
            np.concatenate([self._flags[rows] | side, flags | street_side]),
        )


def _by_class(data: Dataset, rows: Int) -> Pools:
    return [(rows[data.label[rows] == c], None) for c in range(N_CLASSES)]


def _joined(a: Crops, b: Crops) -> Crops:
    return Crops(np.concatenate([a.xyz, b.xyz]), np.append(a.offsets, a.offsets[-1] + b.offsets[1:]))


def varied(crops: Crops, rng: Generator) -> tuple[Crops, Int]:
    """Crops mirrored about the line of sight, some hidden at a side, with fewer points; (R,) flags of Cut.

    Half of those hidden are as if cut by the view, the others by what stands before them.
    """
    n = len(crops)
    crop_of_point = np.repeat(np.arange(len(crops)), crops.count)
    starts = crops.offsets[:-1]
    if not n:
        return crops, np.zeros(0, np.int64)
    xyz = crops.xyz.astype(np.float64)
    middle = np.add.reduceat(xyz[:, :2], starts) / crops.count[:, None]
    c, s = (middle / np.hypot(*middle.T)[:, None])[crop_of_point].T
    along = c * xyz[:, 0] + s * xyz[:, 1]
    across = c * xyz[:, 1] - s * xyz[:, 0]
    across *= rng.choice([-1.0, 1.0], n)[crop_of_point]
    xyz[:, 0] = c * along - s * across
    xyz[:, 1] = s * along + c * across
    xyz += rng.normal(0, 0.006, xyz.shape)
    xyz[:, 2] += rng.normal(0, 0.015, n)[crop_of_point]
    # Hide a share of the width from one side; the mirroring above makes it either.
    low = np.minimum.reduceat(across, starts)
    high = np.maximum.reduceat(across, starts)
    hidden = np.where(rng.random(n) < HIDDEN_SHARE, rng.uniform(0.0, MAX_HIDDEN, n), 0.0)
    keep = (across - low[crop_of_point]) >= (hidden * (high - low))[crop_of_point]
    keep &= rng.random(len(crop_of_point)) < rng.uniform(0.4, 1.0, n)[crop_of_point]
    few = np.bincount(crop_of_point[keep], minlength=n) < MIN_POINTS
    keep |= few[crop_of_point]
    cut = Cut.SIDE * ((hidden > 0) & ~few & (rng.random(n) < 0.5))
    return Crops(
        xyz[keep].astype(np.float32), np.append(0, np.cumsum(np.bincount(crop_of_point[keep], minlength=n)))
    ), cut


def cut_near(crops: Crops, sensors: Sensors, rng: Generator) -> tuple[Crops, Sensors, Int, Int]:
    """The crops that a random sensor shows at a random mount and distance.

    Args:
        crops: in the frame of the sensors that measured them.
        sensors: sensors of the crops.
        rng: source of the random choices.

    Returns:
        crops, the sensors that would measure them so, (R,) rows of the crops given, and (R,) flags of Cut.
    """
    n = len(crops)
    crop_of_point = np.repeat(np.arange(len(crops)), crops.count)
    low, high = SPANS[rng.integers(len(SPANS), size=n)].T
    mount_m = rng.uniform(*HEIGHT_M, n)
    near_m = np.exp(rng.uniform(*LOG_RANGE, n))
    xyz = crops.xyz.astype(np.float64)
    distance = np.hypot(xyz[:, 0], xyz[:, 1])
    # Move each crop along the line of sight of its first point until its nearest point is near_m away.
    nearest = np.minimum.reduceat(distance, crops.offsets[:-1])
    bearing = np.arctan2(xyz[:, 1], xyz[:, 0])
    first = bearing[crops.offsets[:-1]]
    unit = np.stack([np.cos(first), np.sin(first)], axis=1)
    xyz[:, :2] += ((near_m - nearest)[:, None] * unit)[crop_of_point]
    xyz[:, 2] -= (sensors.ground_z_m + mount_m)[crop_of_point]
    # Points above the highest and below the lowest beam are not seen.
    tangent = xyz[:, 2] / np.maximum(np.hypot(xyz[:, 0], xyz[:, 1]), 0.1)
    above = tangent > high[crop_of_point]
    below = tangent < low[crop_of_point]
    keep = ~above & ~below
    cut = Cut.TOP * np.maximum.reduceat(above, crops.offsets[:-1])
    cut |= Cut.BOTTOM * np.maximum.reduceat(below, crops.offsets[:-1])
    count = np.bincount(crop_of_point[keep], minlength=n)
    rows = np.flatnonzero((count >= MIN_CUT_POINTS) & (cut > 0))
    kept = keep & np.isin(crop_of_point, rows)
    wider = np.square(np.maximum(nearest, 1.0) / np.maximum(near_m, 1.0))  # each point covers the same area
    near = replace(sensors, ground_z_m=-mount_m, elevation_deg=sensors.elevation_deg * wider)
    out = Crops(xyz[kept].astype(np.float32), np.append(0, np.cumsum(count[rows])))
    return out, near.take(rows), rows, cut[rows]


def cut_flags(data: Dataset) -> Int:
    """(R,) flags of Cut of the crops of a data set, by the beams of their sensors."""
    flags = np.zeros(len(data), np.int64)
    for number, name in enumerate(data.sensor_names):
        rows = np.flatnonzero(data.sensor == number)
        if name in SENSORS and len(rows):
            sensor = replace(profile.load(name).sensor, min_range_m=MIN_RANGE_M)
            crops = data.take(rows)
            at_sensor = np.zeros((len(rows), 7))  # none is too far away
            flags[rows] = ViewEnds(sensor, MAX_HEIGHT_M).cut(crops.xyz.T, crops.offsets, at_sensor)
    return flags
