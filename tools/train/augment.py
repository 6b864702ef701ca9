"""Multiplies real crops honestly: other ranges at the sensor's resolution, occluders, sizes, slopes, dropped returns.

Everything happens in the sensor frame, where ranges and beams mean something, and to background as to objects, so
that no trace of the augmentation tells a class.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.random import Generator

from modt.classification.crops import Crops
from modt.types import Bool, Float64, Int
from tools.train.dataset import SENSOR_HEIGHT_M

MAX_RANGE_M = 75.0
FEWEST = 6
"""Points that an augmented crop must keep; it is left whole otherwise."""


@dataclass(frozen=True)
class Beams:
    """Angular resolution of the sensor that is imitated."""

    azimuth_deg: float = 0.17
    elevation_deg: float = 0.42


def augment(crops: Crops, beams: Beams, rng: Generator) -> Crops:
    """Each crop seen anew."""
    n, count = len(crops), crops.count
    owner = np.repeat(np.arange(n), count)
    xyz = crops.xyz.astype(np.float64)
    centre = np.stack([np.add.reduceat(xyz[:, k], crops.offsets[:-1]) / count for k in range(3)], axis=1)
    xyz = _reshape(xyz, centre, owner, rng)
    xyz = _move(xyz, centre, owner, rng)
    keep = _at_resolution(xyz, owner, beams, rng)
    keep = _unless_lost(keep, _shadow(xyz, owner, keep, n, rng), owner, n)
    keep = _unless_lost(keep, rng.random(len(owner)) < 1 - rng.uniform(0, 0.35, n)[owner] ** 1.5, owner, n)
    xyz += rng.normal(0, 0.012, xyz.shape)
    rho = np.hypot(*centre[:, :2].T)
    xyz[:, 2] += (rng.normal(0, 1, n) * (0.05 + 0.004 * rho))[owner]
    return Crops(
        xyz[keep].astype(np.float32), np.append(0, np.cumsum(np.bincount(owner[keep], minlength=n))).astype(np.int64)
    )


def limit(crops: Crops, most: int, rng: Generator) -> Crops:
    """At most so many points of each crop, drawn at random."""
    owner = np.repeat(np.arange(len(crops)), crops.count)
    order = np.lexsort((rng.random(len(owner)), owner))
    kept = np.sort(order[np.arange(len(owner)) - crops.offsets[:-1][owner] < most])
    return Crops(crops.xyz[kept], np.append(0, np.cumsum(np.minimum(crops.count, most))))


def _reshape(xyz: Float64, centre: Float64, owner: Int, rng: Generator) -> Float64:
    """Mirrored about the line of sight, turned a little, of another size."""
    n = len(centre)
    bearing = np.arctan2(centre[:, 1], centre[:, 0])
    local = _turn(xyz - np.c_[centre[:, :2], np.zeros(n)][owner], -bearing[owner])
    local[:, 1] *= rng.choice([-1.0, 1.0], n)[owner]
    local = _turn(local, rng.normal(0, np.deg2rad(6), n)[owner])
    size = rng.uniform(0.9, 1.1, n)
    local[:, :2] *= size[owner, None]
    ground = -SENSOR_HEIGHT_M
    local[:, 2] = ground + (local[:, 2] - ground) * (size * rng.uniform(0.96, 1.04, n))[owner]
    out: Float64 = _turn(local, bearing[owner]) + np.c_[centre[:, :2], np.zeros(n)][owner]
    return out


def _turn(xyz: Float64, angle: Float64) -> Float64:
    c, s = np.cos(angle), np.sin(angle)
    return np.stack([c * xyz[:, 0] - s * xyz[:, 1], s * xyz[:, 0] + c * xyz[:, 1], xyz[:, 2]], axis=1)


def _move(xyz: Float64, centre: Float64, owner: Int, rng: Generator) -> Float64:
    """To another range along the line of sight; mostly farther, since no point can be added."""
    rho = np.hypot(*centre[:, :2].T)
    farthest = np.clip(MAX_RANGE_M / rho, 1.0, 4.0)
    factor = np.where(rng.random(len(rho)) < 0.6, farthest ** rng.random(len(rho)), rng.uniform(0.9, 1.05, len(rho)))
    moved = xyz.copy()
    moved[:, :2] += (centre[:, :2] * (factor - 1)[:, None])[owner]
    return moved


def _at_resolution(xyz: Float64, owner: Int, beams: Beams, rng: Generator) -> Bool:
    """One return a beam: of the points that a beam of the sensor would hit, one is kept."""
    azimuth = np.rad2deg(np.arctan2(xyz[:, 1], xyz[:, 0])) / beams.azimuth_deg
    elevation = np.rad2deg(np.arctan2(xyz[:, 2], np.hypot(xyz[:, 0], xyz[:, 1]))) / beams.elevation_deg
    phase = rng.random((owner.max(initial=0) + 1, 2)) if len(owner) else np.zeros((0, 2))
    cell = np.stack([azimuth, elevation], axis=1) + phase[owner]
    key = (owner.astype(np.int64) << 32) | (np.floor(cell[:, 0]).astype(np.int64) + 8192 << 16)
    key |= np.floor(cell[:, 1]).astype(np.int64) + 8192
    order = rng.permutation(len(key))
    _, first = np.unique(key[order], return_index=True)
    keep = np.zeros(len(key), np.bool_)
    keep[order[first]] = True
    return _unless_lost(np.ones(len(key), np.bool_), keep, owner, int(owner.max(initial=-1)) + 1)


def _shadow(xyz: Float64, owner: Int, keep: Bool, n: int, rng: Generator) -> Bool:
    """What an occluder leaves: a part cut off at one side, at the foot or at the top, or a post in between."""
    across = np.arctan2(xyz[:, 1], xyz[:, 0])
    kind = rng.choice(5, n, p=[0.5, 0.28, 0.1, 0.05, 0.07])
    cut = rng.uniform(0.1, 0.65, n)
    left = rng.random(n) < 0.5
    a = _rank(across, owner, keep, n)
    z = _rank(xyz[:, 2], owner, keep, n)
    side = np.where(left[owner], a, 1 - a) > cut[owner]
    foot, top = z > cut[owner], z < 1 - 0.5 * cut[owner]
    post = np.abs(a - (0.2 + 0.6 * cut)[owner]) > 0.08
    chosen: Bool = np.choose(kind[owner], [np.ones(len(owner), np.bool_), side, foot, top, post])
    return chosen


def _rank(value: Float64, owner: Int, keep: Bool, n: int) -> Float64:
    """Where each value stands between its crop's least (0) and greatest (1)."""
    low, high = np.full(n, np.inf), np.full(n, -np.inf)
    np.minimum.at(low, owner[keep], value[keep])
    np.maximum.at(high, owner[keep], value[keep])
    rank: Float64 = (value - low[owner]) / np.maximum(high - low, 1e-6)[owner]
    return rank


def _unless_lost(keep: Bool, further: Bool, owner: Int, n: int) -> Bool:
    """Keep further what still leaves enough of its crop."""
    both = keep & further
    enough = np.bincount(owner[both], minlength=n) >= FEWEST
    return np.where(enough[owner], both, keep)
