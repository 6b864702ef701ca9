"""Crops as a low sensor at arm's length would see them: moved near, and cut where its beams end."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from numpy.random import Generator

from modt import profile
from modt.classification.crops import Crops
from modt.config import SegmentationConfig
from modt.segmentation.view_ends import ViewEnds
from modt.types import Cut, Float64, Int
from modt_desk.simulation.sensors import SENSORS
from tools.train.dataset import Dataset, Sensors
from tools.train.near_scans import HEIGHT_M, MIN_RANGE_M, RANGE_M

MAX_HEIGHT_M = SegmentationConfig().max_height_m
MIN_POINTS = 20
"""A crop of which the beams show fewer points is left out."""
LOG_RANGE = math.log(RANGE_M[0]), math.log(RANGE_M[1])
SPANS: Float64 = np.tan(np.deg2rad([s for s in (profile.load(n).sensor.span_deg for n in SENSORS) if s is not None]))
"""(S, 2) rise over distance of the lowest and the highest beam, sensor by sensor."""


def cut_near(crops: Crops, sensors: Sensors, rng: Generator) -> tuple[Crops, Sensors, Int, Int]:
    """The crops that a random sensor still shows at a random mount and distance.

    Args:
        crops: in the frame of the sensors that measured them.
        sensors: of the crops.
        rng: of the random choices.

    Returns:
        crops, the sensors that would measure them so, (R,) rows of the crops given, and (R,) flags of Cut.
    """
    n, owner = len(crops), np.repeat(np.arange(len(crops)), crops.count)
    low, high = SPANS[rng.integers(len(SPANS), size=n)].T
    mount_m, near_m = rng.uniform(*HEIGHT_M, n), np.exp(rng.uniform(*LOG_RANGE, n))
    xyz = crops.xyz.astype(np.float64)
    distance = np.hypot(xyz[:, 0], xyz[:, 1])
    nearest = np.minimum.reduceat(distance, crops.offsets[:-1])
    bearing = np.arctan2(xyz[:, 1], xyz[:, 0])
    first = bearing[crops.offsets[:-1]]
    unit = np.stack([np.cos(first), np.sin(first)], axis=1)
    xyz[:, :2] += ((near_m - nearest)[:, None] * unit)[owner]
    xyz[:, 2] -= (sensors.ground_z_m + mount_m)[owner]
    tangent = xyz[:, 2] / np.maximum(np.hypot(xyz[:, 0], xyz[:, 1]), 0.1)
    above, below = tangent > high[owner], tangent < low[owner]
    keep = ~above & ~below
    cut = Cut.TOP * np.maximum.reduceat(above, crops.offsets[:-1])
    cut |= Cut.BOTTOM * np.maximum.reduceat(below, crops.offsets[:-1])
    count = np.bincount(owner[keep], minlength=n)
    rows = np.flatnonzero((count >= MIN_POINTS) & (cut > 0))
    kept = keep & np.isin(owner, rows)
    wider = np.square(np.maximum(nearest, 1.0) / np.maximum(near_m, 1.0))  # the same area a point
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
