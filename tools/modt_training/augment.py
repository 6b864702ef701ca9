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
from modt_training.dataset import Sensors

MAX_RANGE_M = 75.0
"""Greatest range to which a crop is moved [m]."""
MIN_POINTS = 6
"""Minimum number of points of an augmented crop; a step that would leave fewer is skipped."""
MAX_DROPPED = 0.35
"""A crop loses the share u ** DROPPED_EXPONENT of its returns, with u uniform from 0 to this."""
DROPPED_EXPONENT = 1.5
"""Greater than 1, so that most crops lose few returns."""
POINT_NOISE_M = 0.012
"""Standard deviation of the noise of each coordinate of a point [m]."""
GROUND_NOISE_M = 0.05
"""Standard deviation of the height of a crop at the sensor [m]."""
GROUND_NOISE_SLOPE = 0.002
"""Growth of that deviation with the range [m/m]."""
OCCLUSIONS = ("none", "side", "foot", "top", "post")
"""Part of a crop that an occluder hides."""
OCCLUSION_SHARE = (0.5, 0.28, 0.1, 0.05, 0.07)
"""Share of the crops with each of these."""
HIDDEN_SHARE = (0.1, 0.65)
"""Least and greatest share of the extent of a crop that is hidden at a side or the foot; half of it at the top."""
HALF_POST = 0.08
"""Half the width of the post, a share of the width of the crop."""
BEAM_STEPS = (1, 2, 4)
"""Every n-th beam of a crop is kept."""
BEAM_STEP_SHARE = (0.5, 0.3, 0.2)
"""Share of the crops with each of these n."""
MAX_ELEVATION_DEG = 2.0
"""Greatest angle between two beams that are kept."""
NOISY_SHARE = 0.6
"""Share of the crops of worn sensors with noisy ranges."""
MAX_NOISE_M = 0.12
"""Greatest standard deviation of the noise of a range."""
LOST_BEAMS = (0.0, 0.15, 0.3, 0.5)
"""Share of the beams of a crop that a worn sensor loses; each is as frequent as the others."""


def augment(crops: Crops, sensors: Sensors, rng: Generator) -> tuple[Crops, Sensors]:
    """Augment each crop once; the crops and the sensors that would measure them so, none finer than its own."""
    n = len(crops)
    count = crops.count
    crop_of_point = np.repeat(np.arange(n), count)
    xyz = crops.xyz.astype(np.float64)
    centre = np.stack([np.add.reduceat(xyz[:, k], crops.offsets[:-1]) / count for k in range(3)], axis=1)
    xyz = _deform(xyz, centre, crop_of_point, sensors.ground_z_m, rng)
    xyz = _change_range(xyz, centre, crop_of_point, rng)
    keep, sensors = _one_return_per_beam(xyz, crop_of_point, sensors, rng)
    keep = _keep_enough(keep, _occlude(xyz, crop_of_point, keep, n, rng), crop_of_point, n)
    draw = rng.random(len(crop_of_point))
    returned = draw < 1 - rng.uniform(0, MAX_DROPPED, n)[crop_of_point] ** DROPPED_EXPONENT
    keep = _keep_enough(keep, returned, crop_of_point, n)
    xyz += rng.normal(0, POINT_NOISE_M, xyz.shape)
    rho = np.hypot(*centre[:, :2].T)
    xyz[:, 2] += (rng.normal(0, 1, n) * (GROUND_NOISE_M + GROUND_NOISE_SLOPE * rho))[crop_of_point]
    return _kept(xyz, keep, crop_of_point, n), sensors


def worn(crops: Crops, sensors: Sensors, rng: Generator) -> Crops:
    """Each crop as a worn sensor measures it: with noisy ranges, and without some of its beams."""
    n = len(crops)
    crop_of_point = np.repeat(np.arange(n), crops.count)
    xyz = crops.xyz.astype(np.float64)
    sigma_m = np.where(rng.random(n) < NOISY_SHARE, rng.uniform(0.0, MAX_NOISE_M, n), 0.0)
    error_m = sigma_m[crop_of_point] * rng.standard_normal(len(xyz))
    beam = np.floor(_elevation_deg(xyz) / sensors.elevation_deg[crop_of_point] + rng.random(n)[crop_of_point])
    _, beam_of_crop = np.unique(crop_of_point << 16 | beam.astype(np.int64) + 32768, return_inverse=True)
    lost_share = rng.choice(LOST_BEAMS, n)
    is_lost = rng.random(len(xyz))[beam_of_crop] < lost_share[crop_of_point]
    keep = _keep_enough(np.ones(len(xyz), np.bool_), ~is_lost, crop_of_point, n)
    xyz *= 1.0 + (error_m / np.linalg.norm(xyz, axis=1))[:, None]
    return _kept(xyz, keep, crop_of_point, n)


def _kept(xyz: Float64, keep: Bool, crop_of_point: Int, n: int) -> Crops:
    """The n crops of the points that are kept."""
    offsets = np.append(0, np.cumsum(np.bincount(crop_of_point[keep], minlength=n)))
    return Crops(xyz[keep].astype(np.float32), offsets)


def _elevation_deg(xyz: Float64) -> Float64:
    return np.asarray(np.rad2deg(np.arctan2(xyz[:, 2], np.hypot(xyz[:, 0], xyz[:, 1]))))


def subsample(crops: Crops, limit: int, rng: Generator) -> Crops:
    """Subsample each crop at random to at most `limit` points."""
    crop_of_point = np.repeat(np.arange(len(crops)), crops.count)
    order = np.lexsort((rng.random(len(crop_of_point)), crop_of_point))
    kept = np.sort(order[np.arange(len(crop_of_point)) - crops.offsets[:-1][crop_of_point] < limit])
    return Crops(crops.xyz[kept], np.append(0, np.cumsum(np.minimum(crops.count, limit))))


def distance_m(crops: Crops) -> Float64:
    """(R,) distance of the middle of the points of each crop."""
    middle = np.add.reduceat(crops.xyz[:, :2], crops.offsets[:-1]) / crops.count[:, None]
    return np.asarray(np.hypot(*middle.T), np.float64)


def _deform(xyz: Float64, centre: Float64, crop_of_point: Int, ground_z_m: Float64, rng: Generator) -> Float64:
    """Mirror about the line of sight, rotate slightly, scale."""
    n = len(centre)
    bearing = np.arctan2(centre[:, 1], centre[:, 0])
    local = _rotate(xyz - np.c_[centre[:, :2], np.zeros(n)][crop_of_point], -bearing[crop_of_point])
    local[:, 1] *= rng.choice([-1.0, 1.0], n)[crop_of_point]
    local = _rotate(local, rng.normal(0, np.deg2rad(6), n)[crop_of_point])
    size = rng.uniform(0.9, 1.1, n)
    local[:, :2] *= size[crop_of_point, None]
    ground = ground_z_m[crop_of_point]
    local[:, 2] = ground + (local[:, 2] - ground) * (size * rng.uniform(0.96, 1.04, n))[crop_of_point]
    out: Float64 = _rotate(local, bearing[crop_of_point]) + np.c_[centre[:, :2], np.zeros(n)][crop_of_point]
    return out


def _rotate(xyz: Float64, angle: Float64) -> Float64:
    c, s = np.cos(angle), np.sin(angle)
    return np.stack([c * xyz[:, 0] - s * xyz[:, 1], s * xyz[:, 0] + c * xyz[:, 1], xyz[:, 2]], axis=1)


def _change_range(xyz: Float64, centre: Float64, crop_of_point: Int, rng: Generator) -> Float64:
    """Translate along the line of sight; mostly away from the sensor, since no point can be added."""
    rho = np.hypot(*centre[:, :2].T)
    farthest = np.clip(MAX_RANGE_M / rho, 1.0, 4.0)
    factor = np.where(rng.random(len(rho)) < 0.6, farthest ** rng.random(len(rho)), rng.uniform(0.9, 1.05, len(rho)))
    moved = xyz.copy()
    moved[:, :2] += (centre[:, :2] * (factor - 1)[:, None])[crop_of_point]
    return moved


def _one_return_per_beam(xyz: Float64, crop_of_point: Int, sensors: Sensors, rng: Generator) -> tuple[Bool, Sensors]:
    """(K,) mask of one random point for each beam and azimuth, of some crops every second or fourth beam alone.

    A crop keeps all its points or all its beams where too few would be left.
    """
    n = len(sensors.ground_z_m)
    azimuth = np.rad2deg(np.arctan2(xyz[:, 1], xyz[:, 0])) / sensors.azimuth_deg[crop_of_point]
    elevation = _elevation_deg(xyz) / sensors.elevation_deg[crop_of_point]
    # Cells of one beam and one azimuth step, with an offset of their own in each crop.
    cell = np.stack([azimuth, elevation], axis=1) + rng.random((n, 2))[crop_of_point]
    column, beam = np.floor(cell).astype(np.int64).T + 32768
    # Crop, column and beam in one number; of each, the first point in random order is kept.
    key = crop_of_point << 32 | column << 16 | beam
    order = rng.permutation(len(key))
    _, first = np.unique(key[order], return_index=True)
    keep = np.zeros(len(key), np.bool_)
    keep[order[first]] = True
    keep = _keep_enough(np.ones(len(key), np.bool_), keep, crop_of_point, n)
    # Then every second or fourth beam alone, unless the beams that are left would be too far apart.
    step = rng.choice(BEAM_STEPS, n, p=BEAM_STEP_SHARE)
    step[sensors.elevation_deg * step > MAX_ELEVATION_DEG] = 1
    thin = _keep_enough(
        keep, (beam + rng.integers(0, 4, n)[crop_of_point]) % step[crop_of_point] == 0, crop_of_point, n
    )
    unthinned = np.bincount(crop_of_point[thin], minlength=n) == np.bincount(crop_of_point[keep], minlength=n)
    return thin, replace(sensors, elevation_deg=np.where(unthinned, 1, step) * sensors.elevation_deg)


def _occlude(xyz: Float64, crop_of_point: Int, keep: Bool, n: int, rng: Generator) -> Bool:
    """(K,) mask of points left by an occluder: one side, the foot or the top cut off, or a post in front."""
    across = np.arctan2(xyz[:, 1], xyz[:, 0])
    kind = rng.choice(len(OCCLUSIONS), n, p=OCCLUSION_SHARE)
    cut = rng.uniform(*HIDDEN_SHARE, n)
    left = rng.random(n) < 0.5
    a = _relative_position(across, crop_of_point, keep, n)
    z = _relative_position(xyz[:, 2], crop_of_point, keep, n)
    side = np.where(left[crop_of_point], a, 1 - a) > cut[crop_of_point]
    foot = z > cut[crop_of_point]
    top = z < 1 - 0.5 * cut[crop_of_point]
    post = np.abs(a - (0.2 + 0.6 * cut)[crop_of_point]) > HALF_POST
    left_by = {"none": np.ones(len(crop_of_point), np.bool_), "side": side, "foot": foot, "top": top, "post": post}
    chosen: Bool = np.choose(kind[crop_of_point], [left_by[name] for name in OCCLUSIONS])
    return chosen


def _relative_position(value: Float64, crop_of_point: Int, keep: Bool, n: int) -> Float64:
    """(K,) values scaled to 0 (minimum of the crop) to 1 (maximum)."""
    low = np.full(n, np.inf)
    high = np.full(n, -np.inf)
    np.minimum.at(low, crop_of_point[keep], value[keep])
    np.maximum.at(high, crop_of_point[keep], value[keep])
    scaled: Float64 = (value - low[crop_of_point]) / np.maximum(high - low, 1e-6)[crop_of_point]
    return scaled


def _keep_enough(keep: Bool, further: Bool, crop_of_point: Int, n: int) -> Bool:
    """(K,) `keep & further` for crops with at least MIN_POINTS of it, else `keep`."""
    both = keep & further
    enough = np.bincount(crop_of_point[both], minlength=n) >= MIN_POINTS
    return np.where(enough[crop_of_point], both, keep)
