"""Augmentation of crops: range, resolution of the sensor, occlusion, size, heading, slope, dropped returns.

All transforms act in the sensor frame, where ranges and beams are defined, and on every class alike, so that no
artefact of the augmentation reveals the class.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.random import Generator

from modt.classification.crops import Crops
from modt.types import Bool, Float64, Int
from tools.train.dataset import Sensors

MAX_RANGE_M = 75.0
MIN_POINTS = 6
"""Minimum number of points of an augmented crop; a step that would leave fewer is skipped."""


BEAM_STEPS = (1, 2, 4)
"""Every n-th beam of a crop is kept."""
BEAM_STEP_SHARE = (0.5, 0.3, 0.2)
"""Share of the crops with each of these n."""
MAX_ELEVATION_DEG = 2.0
"""Greatest angle between two beams that are kept."""


def augment(crops: Crops, sensors: Sensors, rng: Generator) -> tuple[Crops, Sensors]:
    """Augment each crop once; the crops and the sensors that would measure them so, none finer than its own."""
    n = len(crops)
    count = crops.count
    owner = np.repeat(np.arange(n), count)
    xyz = crops.xyz.astype(np.float64)
    centre = np.stack([np.add.reduceat(xyz[:, k], crops.offsets[:-1]) / count for k in range(3)], axis=1)
    xyz = _deform(xyz, centre, owner, sensors.ground_z_m, rng)
    xyz = _change_range(xyz, centre, owner, rng)
    keep, sensors = _one_return_per_beam(xyz, owner, sensors, rng)
    keep = _keep_enough(keep, _occlude(xyz, owner, keep, n, rng), owner, n)
    keep = _keep_enough(keep, rng.random(len(owner)) < 1 - rng.uniform(0, 0.35, n)[owner] ** 1.5, owner, n)
    xyz += rng.normal(0, 0.012, xyz.shape)
    rho = np.hypot(*centre[:, :2].T)
    xyz[:, 2] += (rng.normal(0, 1, n) * (0.05 + 0.002 * rho))[owner]
    offsets = np.append(0, np.cumsum(np.bincount(owner[keep], minlength=n)))
    return Crops(xyz[keep].astype(np.float32), offsets), sensors


def subsample(crops: Crops, limit: int, rng: Generator) -> Crops:
    """Subsample each crop at random to at most `limit` points."""
    owner = np.repeat(np.arange(len(crops)), crops.count)
    order = np.lexsort((rng.random(len(owner)), owner))
    kept = np.sort(order[np.arange(len(owner)) - crops.offsets[:-1][owner] < limit])
    return Crops(crops.xyz[kept], np.append(0, np.cumsum(np.minimum(crops.count, limit))))


def _deform(xyz: Float64, centre: Float64, owner: Int, ground_z_m: Float64, rng: Generator) -> Float64:
    """Mirror about the line of sight, rotate slightly, scale."""
    n = len(centre)
    bearing = np.arctan2(centre[:, 1], centre[:, 0])
    local = _rotate(xyz - np.c_[centre[:, :2], np.zeros(n)][owner], -bearing[owner])
    local[:, 1] *= rng.choice([-1.0, 1.0], n)[owner]
    local = _rotate(local, rng.normal(0, np.deg2rad(6), n)[owner])
    size = rng.uniform(0.9, 1.1, n)
    local[:, :2] *= size[owner, None]
    ground = ground_z_m[owner]
    local[:, 2] = ground + (local[:, 2] - ground) * (size * rng.uniform(0.96, 1.04, n))[owner]
    out: Float64 = _rotate(local, bearing[owner]) + np.c_[centre[:, :2], np.zeros(n)][owner]
    return out


def _rotate(xyz: Float64, angle: Float64) -> Float64:
    c, s = np.cos(angle), np.sin(angle)
    return np.stack([c * xyz[:, 0] - s * xyz[:, 1], s * xyz[:, 0] + c * xyz[:, 1], xyz[:, 2]], axis=1)


def _change_range(xyz: Float64, centre: Float64, owner: Int, rng: Generator) -> Float64:
    """Translate along the line of sight; mostly away from the sensor, since no point can be added."""
    rho = np.hypot(*centre[:, :2].T)
    farthest = np.clip(MAX_RANGE_M / rho, 1.0, 4.0)
    factor = np.where(rng.random(len(rho)) < 0.6, farthest ** rng.random(len(rho)), rng.uniform(0.9, 1.05, len(rho)))
    moved = xyz.copy()
    moved[:, :2] += (centre[:, :2] * (factor - 1)[:, None])[owner]
    return moved


def _one_return_per_beam(xyz: Float64, owner: Int, sensors: Sensors, rng: Generator) -> tuple[Bool, Sensors]:
    """(K,) mask of one random point for each beam and azimuth, of some crops every second or fourth beam alone.

    A crop keeps all its points or all its beams where too few would be left.
    """
    n = len(sensors.ground_z_m)
    azimuth = np.rad2deg(np.arctan2(xyz[:, 1], xyz[:, 0])) / sensors.azimuth_deg[owner]
    elevation = np.rad2deg(np.arctan2(xyz[:, 2], np.hypot(xyz[:, 0], xyz[:, 1]))) / sensors.elevation_deg[owner]
    cell = np.stack([azimuth, elevation], axis=1) + rng.random((n, 2))[owner]
    column, beam = np.floor(cell).astype(np.int64).T + 32768
    key = owner << 32 | column << 16 | beam
    order = rng.permutation(len(key))
    _, first = np.unique(key[order], return_index=True)
    keep = np.zeros(len(key), np.bool_)
    keep[order[first]] = True
    keep = _keep_enough(np.ones(len(key), np.bool_), keep, owner, n)
    step = rng.choice(BEAM_STEPS, n, p=BEAM_STEP_SHARE)
    step[sensors.elevation_deg * step > MAX_ELEVATION_DEG] = 1
    thin = _keep_enough(keep, (beam + rng.integers(0, 4, n)[owner]) % step[owner] == 0, owner, n)
    kept = np.bincount(owner[thin], minlength=n) == np.bincount(owner[keep], minlength=n)
    return thin, replace(sensors, elevation_deg=np.where(kept, 1, step) * sensors.elevation_deg)


def _occlude(xyz: Float64, owner: Int, keep: Bool, n: int, rng: Generator) -> Bool:
    """(K,) mask of points left by an occluder: one side, the foot or the top cut off, or a post in front."""
    across = np.arctan2(xyz[:, 1], xyz[:, 0])
    kind = rng.choice(5, n, p=[0.5, 0.28, 0.1, 0.05, 0.07])
    cut = rng.uniform(0.1, 0.65, n)
    left = rng.random(n) < 0.5
    a = _relative_position(across, owner, keep, n)
    z = _relative_position(xyz[:, 2], owner, keep, n)
    side = np.where(left[owner], a, 1 - a) > cut[owner]
    foot = z > cut[owner]
    top = z < 1 - 0.5 * cut[owner]
    post = np.abs(a - (0.2 + 0.6 * cut)[owner]) > 0.08
    chosen: Bool = np.choose(kind[owner], [np.ones(len(owner), np.bool_), side, foot, top, post])
    return chosen


def _relative_position(value: Float64, owner: Int, keep: Bool, n: int) -> Float64:
    """(K,) values scaled to 0 (minimum of the crop) to 1 (maximum)."""
    low = np.full(n, np.inf)
    high = np.full(n, -np.inf)
    np.minimum.at(low, owner[keep], value[keep])
    np.maximum.at(high, owner[keep], value[keep])
    scaled: Float64 = (value - low[owner]) / np.maximum(high - low, 1e-6)[owner]
    return scaled


def _keep_enough(keep: Bool, further: Bool, owner: Int, n: int) -> Bool:
    """(K,) `keep & further` for crops with at least MIN_POINTS of it, else `keep`."""
    both = keep & further
    enough = np.bincount(owner[both], minlength=n) >= MIN_POINTS
    return np.where(enough[owner], both, keep)
