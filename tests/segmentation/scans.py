"""Small scans of known scenes: rays against a floor and upright boxes."""

import numpy as np

from modt.config import SegmentationConfig, SensorConfig
from modt.geometry import FieldOfView
from modt.segmentation.segmenter import Segmenter
from modt.segmentation.tuning import SegmentationTuning

HDL_64E = np.deg2rad(np.linspace(-24.8, 2.0, 64))
VLP_16 = np.deg2rad(np.linspace(-15.0, 15.0, 16))


def elevation_deg(points):
    """(N,) elevations of points."""
    return np.rad2deg(np.arctan2(points[:, 2], np.hypot(points[:, 0], points[:, 1])))


def rays(elevation=HDL_64E, azimuth_deg=(-180.0, 180.0), step_deg=0.5):
    """(n, 3) unit directions, beam by beam."""
    azimuth = np.deg2rad(np.arange(*azimuth_deg, step_deg))
    e, a = (v.ravel() for v in np.meshgrid(elevation, azimuth, indexing="ij"))
    return np.stack([np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)], axis=1)


def floor_ranges(direction, profile, reach_m=70.0, step_m=0.1):
    """(n,) distance at which each ray first goes below z = profile(x, y), infinite where it never does."""
    hit = np.full(len(direction), np.inf)
    for r in np.arange(1.0, reach_m, step_m):
        x, y, z = (direction * r).T
        hit[np.isinf(hit) & (z < profile(x, y))] = r
    return hit


def box_ranges(direction, low, high):
    """(n,) distance at which each ray enters the box from low to high, infinite where it misses."""
    with np.errstate(divide="ignore"):
        near, far = np.sort(np.stack([np.asarray(low) / direction, np.asarray(high) / direction]), axis=0)
    enter, leave = near.max(axis=1), far.min(axis=1)
    return np.where((enter < leave) & (enter > 0), enter, np.inf)


def scan(boxes=(), height_m=1.73, elevation=HDL_64E, azimuth_deg=(-180.0, 180.0), step_deg=0.5, noise_m=0.01, seed=0):
    """(n, 4) points of a flat floor with boxes (x, y, l, w, bottom, top; heights above the floor) upon it.

    Also (n,) what each point lies on: 0 the floor, i + 1 box i.
    """
    direction = rays(elevation, azimuth_deg, step_deg)
    down = direction[:, 2] < -1e-3
    ranges = [np.where(down, -height_m / np.where(down, direction[:, 2], -1.0), np.inf)]
    for x, y, length, width, bottom, top in boxes:
        low = (x - length / 2, y - width / 2, bottom - height_m)
        ranges.append(box_ranges(direction, low, (x + length / 2, y + width / 2, top - height_m)))
    nearest = np.min(ranges, axis=0)
    seen = nearest < 70.0
    noise = np.random.default_rng(seed).normal(0.0, noise_m, seen.sum())
    points = np.zeros((seen.sum(), 4), np.float32)
    points[:, :3] = direction[seen] * (nearest[seen] + noise)[:, None]
    return points, np.argmin(ranges, axis=0)[seen]


def points_by_box(boxes, seed=0, step_deg=0.17, tuning=SegmentationTuning()):
    """Number of points of each proposal of a scene ahead by the box that they lie on."""
    points, on = scan(boxes, step_deg=step_deg, azimuth_deg=(-40, 40), seed=seed)
    sensor = SensorConfig(azimuth_step_deg=step_deg)
    found = Segmenter(SegmentationConfig(), sensor, FieldOfView(), tuning=tuning).segment(points)
    ends = zip(found.offsets, found.offsets[1:], strict=False)
    return [np.bincount(on[found.members[a:b]], minlength=len(boxes) + 1)[1:] for a, b in ends]
