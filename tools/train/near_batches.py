"""Batches of near crops: simulated ones, and crops of the streets as a low sensor would see them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.random import Generator

from modt.classes import N_CLASSES
from modt.classification.crops import Crops
from modt.types import Cut, Float64, Int
from tools.train.augment import subsample
from tools.train.dataset import SYNTHETIC, Dataset, Sensors
from tools.train.near_cut import cut_flags, cut_near

SHARE = np.array([0.5, 0.08, 0.38, 0.04])
"""Shares of the classes in a batch."""
NEAR_BATCH, CUT_BATCH = 72, 40
"""Simulated crops of a batch, and crops of the streets that are cut near; some show too little and are left out."""
CUT_RANGE_M, CUT_POINTS, MAX_POINTS = 25.0, 60, 800
"""Crops of the streets that are cut near: how far they may be, points that they need, and points used of each."""
HIDDEN_SHARE, MAX_HIDDEN, MIN_POINTS = 0.2, 0.45, 8
"""Crops hidden at a side, how much of one may be hidden, and points that are left of it."""


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
        near: crops of build_crops.near_crops.
        streets: crops of the streets; real ones that show enough are cut near.
    """

    def __init__(self, near: Dataset, streets: Dataset) -> None:
        self._near, self._streets = near, streets
        self._flags = cut_flags(near)
        self._pools = _by_class(near, np.flatnonzero(near.trainable))
        shown = streets.trainable & (distance_m(streets.crops) < CUT_RANGE_M) & (streets.crops.count >= CUT_POINTS)
        real = streets.variant != SYNTHETIC
        self._cuttable = _by_class(streets, np.flatnonzero(shown & (real | ~real.any())))

    def draw(self, rng: Generator) -> NearBatch:
        """A batch."""
        rows, street = _draw(self._pools, NEAR_BATCH, rng), _draw(self._cuttable, CUT_BATCH, rng)
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


def distance_m(crops: Crops) -> Float64:
    """(R,) distance of the middle of the points of each crop."""
    middle = np.add.reduceat(crops.xyz[:, :2], crops.offsets[:-1]) / crops.count[:, None]
    return np.asarray(np.hypot(*middle.T), np.float64)


def _by_class(data: Dataset, rows: Int) -> list[Int]:
    return [rows[data.label[rows] == c] for c in range(N_CLASSES)]


def _draw(pools: list[Int], n: int, rng: Generator) -> Int:
    number = rng.multinomial(n, SHARE)
    return np.concatenate([rng.choice(own, k) for own, k in zip(pools, number, strict=True) if len(own)])


def _joined(a: Crops, b: Crops) -> Crops:
    return Crops(np.concatenate([a.xyz, b.xyz]), np.append(a.offsets, a.offsets[-1] + b.offsets[1:]))


def varied(crops: Crops, rng: Generator) -> tuple[Crops, Int]:
    """Crops mirrored about the line of sight, some hidden at a side, with fewer points; (R,) flags of Cut.

    Half of those hidden are as if cut by the view, the others by what stands before them.
    """
    n, owner, starts = len(crops), np.repeat(np.arange(len(crops)), crops.count), crops.offsets[:-1]
    if not n:
        return crops, np.zeros(0, np.int64)
    xyz = crops.xyz.astype(np.float64)
    middle = np.add.reduceat(xyz[:, :2], starts) / crops.count[:, None]
    c, s = (middle / np.hypot(*middle.T)[:, None])[owner].T
    along, across = c * xyz[:, 0] + s * xyz[:, 1], c * xyz[:, 1] - s * xyz[:, 0]
    across *= rng.choice([-1.0, 1.0], n)[owner]
    xyz[:, 0], xyz[:, 1] = c * along - s * across, s * along + c * across
    xyz += rng.normal(0, 0.006, xyz.shape)
    xyz[:, 2] += rng.normal(0, 0.015, n)[owner]
    low, high = np.minimum.reduceat(across, starts), np.maximum.reduceat(across, starts)
    hidden = np.where(rng.random(n) < HIDDEN_SHARE, rng.uniform(0.0, MAX_HIDDEN, n), 0.0)
    keep = (across - low[owner]) >= (hidden * (high - low))[owner]
    keep &= rng.random(len(owner)) < rng.uniform(0.4, 1.0, n)[owner]
    few = np.bincount(owner[keep], minlength=n) < MIN_POINTS
    keep |= few[owner]
    cut = Cut.SIDE * ((hidden > 0) & ~few & (rng.random(n) < 0.5))
    return Crops(xyz[keep].astype(np.float32), np.append(0, np.cumsum(np.bincount(owner[keep], minlength=n)))), cut
