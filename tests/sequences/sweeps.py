"""Random sweeps of any shape, and the promises that hold for each: one label a point, the same by both kernels."""

from __future__ import annotations

import numpy as np
from numpy.random import Generator

from modt.app.assembly import chosen_kernels
from modt.config import ProfileConfig
from modt.geometry import FieldOfView, rotation_zyx
from modt.segmentation.kernels import NUMPY
from modt.segmentation.segmenter import Segmenter
from modt.types import UNLIMITED, Float32, Frame
from tests.segmentation.scans import scan
from tests.segmentation.test_native_kernels import same
from tests.segmentation.test_point_kinds import fog, room
from tests.sequences.promises import Run, config
from tests.sequences.world import ODD

SENSORS = ("vlp-16", "os1-64", "mid-360", "hdl-64e")
"""Profiles of the pipelines, whatever sensor a sweep is like."""
RUN_SWEEPS = 100
"""Sweeps that one pipeline is fed."""
COMPARED = 20
"""One of this many sweeps is segmented by both kernels."""


def empty(_: Generator) -> Float32:
    """No point."""
    return np.zeros((0, 4), np.float32)


def alike(rng: Generator) -> Float32:
    """One point, or up to thousands of equal ones."""
    point = rng.normal(0, 5, (1, 4)).astype(np.float32)
    return point.repeat(rng.choice([1, 2, 300, 5000], p=[0.5, 0.2, 0.25, 0.05]), axis=0)


def foggy(rng: Generator) -> Float32:
    """Scatter around the sensor."""
    return fog(rng, int(rng.integers(1, 800)))


def indoors(rng: Generator) -> Float32:
    """A room."""
    return room(rng, int(rng.integers(1, 800)))


def dust(rng: Generator) -> Float32:
    """Points around a few places."""
    centre = rng.normal(0, 10, (int(rng.integers(1, 6)), 3))
    n = int(rng.integers(1, 500))
    points = np.zeros((n, 4), np.float32)
    points[:, :3] = centre[rng.integers(0, len(centre), n)] + rng.normal(0, rng.choice([0.0, 0.1, 1.0, 10.0]), (n, 3))
    return points


def structured(rng: Generator) -> Float32:
    """Floor, walls, things and at times a ceiling, seen by one to thirty beams."""
    beams = int(rng.choice([1, 4, 8, 16, 30]))
    low, high = np.sort(rng.uniform(-40, 50, 2))
    boxes = []
    for _ in range(rng.integers(0, 6)):
        place = rng.normal(0, 6, 2)
        size = rng.choice([0.2, 0.6, 2.0, 12.0, 40.0], 2)
        bottom = rng.choice([0.0, 0.0, 0.4, 2.0])
        boxes.append((*place, *size, bottom, bottom + rng.choice([0.1, 0.5, 1.8, 4.0])))
    elevation = np.deg2rad(np.linspace(low, high, beams))
    height_m = rng.uniform(0.2, 2.0)
    points, _ = scan(boxes, height_m, elevation, step_deg=rng.choice([3.0, 6.0]), seed=int(rng.integers(1000)))
    return points


MAKERS = (empty, alike, foggy, indoors, dust, structured, structured, structured)
"""Makers of sweeps, of which each is as likely as the others."""


def random_sweep(rng: Generator) -> Float32:
    """(N, 4) points, at times thinned, tilted, scaled, or with odd values."""
    points = MAKERS[rng.integers(len(MAKERS))](rng)
    thinned, tilted, scaled, odd = rng.random(4) < [0.3, 0.2, 0.1, 0.3]
    if thinned:
        points = points[rng.random(len(points)) < rng.random()]
    if tilted:
        points[:, :3] = points[:, :3] @ rotation_zyx(*rng.uniform(-np.pi, np.pi, 3)).T
    if scaled:
        with np.errstate(over="ignore"):
            points[:, :3] *= np.float32(10.0 ** rng.uniform(-30, 30))
    if odd:
        values = ODD[rng.integers(0, len(ODD), (len(points), 3))]
        np.copyto(points[:, :3], values, where=rng.random((len(points), 3)) < rng.random() ** 3)
    points[:, 3] = rng.choice([-1.0, 0.0, 0.5, 1.0])
    return points


def same_by_both_kernels(profile: ProfileConfig, points: Float32) -> None:
    """The proposals and the kinds of the points are those of the reference."""
    found, expected = (
        Segmenter(profile.segmentation, profile.sensor, FieldOfView(), kernels).segment(points.copy())
        for kernels in (chosen_kernels(profile.segmentation.kernels), NUMPY)
    )
    assert same(found, expected)


def feed(seed: int, n: int = RUN_SWEEPS) -> None:
    """Feed a pipeline of a random profile with n random sweeps of a seed.

    Raises:
        AssertionError: a promise was broken; it names the sweep.
    """
    rng = np.random.default_rng(seed)
    run = Run("accurate", config(str(rng.choice(SENSORS)), "kdop"), UNLIMITED)
    pose = np.eye(4) if rng.random() < 0.7 else None
    for index in range(n):
        points = random_sweep(np.random.default_rng([seed, index]))
        try:
            with np.errstate(all="ignore"):
                if index % COMPARED == 0:
                    same_by_both_kernels(run.config, points)
                run.step(Frame(index, 0.1 * index, points, pose))
        except Exception as broken:
            raise AssertionError(f"sweep {index} of seed {seed}, {len(points)} points: {broken!r}") from broken
