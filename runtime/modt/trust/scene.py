"""What stood still must stand where the pose says: obstacles of two sweeps in one log-polar grid.

A turn of the sensor shifts the grid along the bearing, a scale of the ranges along the logarithm of the range, and a
mirror reverses the bearing (Fourier-Mellin).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from modt.geometry import inverse, rotation_zyx, se3
from modt.trust.ground import GroundCheck
from modt.trust.sample import Sample
from modt.types import Float64, Int

BEARINGS = 72
LOG_STEP = 0.08
"""Width of a cell in the logarithm of the range."""
NEAREST_M = 1.0
RANGES = 50
"""Cells along the range, up to 54 m."""
OBSTACLE_M = (0.35, 1.8)
"""Heights above the ground between which a point belongs to an obstacle, and not to the ground
or to a ceiling [m]."""
MIN_POINTS = 40
UNSCALED_FAVOUR = 0.02
"""Share of the points by which a scale has to be better for each of its steps, as places are several steps wide."""


@dataclass(frozen=True, slots=True)
class Change:
    """How the scene changed at once: turned by so many bearings, then mirrored, and scaled by so many steps."""

    mirrored: bool
    turned: int
    scaled: int

    @property
    def matrix(self) -> Float64:
        """(4, 4) the turn and the mirror."""
        T = se3(rotation_zyx(0.0, 0.0, self.turned * 2 * np.pi / BEARINGS), np.zeros(3))
        return np.diag([1.0, -1.0 if self.mirrored else 1.0, 1.0, 1.0]) @ T

    def motion(self, before: Sample, after: Sample) -> Float64:
        """(4, 4) from the sensor frame of a sweep to that of another one, both of them changed like this."""
        T = inverse(after.T_world_sensor) @ before.T_world_sensor
        return T if self.is_none else self.matrix @ T @ np.linalg.inv(self.matrix)

    @property
    def is_none(self) -> bool:
        """Whether it is within the width of the cells."""
        return not self.mirrored and abs(self.turned) <= 2 and abs(self.scaled) <= 1

    def then(self, other: Change) -> Change:
        """Change that these two make, the other one after this."""
        turned = self.turned + (-other.turned if self.mirrored else other.turned)
        turned = (turned + BEARINGS // 2) % BEARINGS - BEARINGS // 2
        return Change(self.mirrored != other.mirrored, turned, self.scaled + other.scaled)

    def __str__(self) -> str:
        parts = []
        if self.mirrored:
            parts.append("mirrored")
        if abs(self.turned) > 2:
            parts.append(f"turned by {self.turned * 360 // BEARINGS} deg")
        if abs(self.scaled) > 1:
            parts.append(f"scaled by {np.exp(self.scaled * LOG_STEP):.2g}")
        return " and ".join(parts)


SAME = Change(False, 0, 0)


def places(sample: Sample, ground: GroundCheck, T: Float64 | None = None) -> Int:
    """(k,) cells of the obstacle points, brought into another sensor frame by T (4, 4)."""
    height_m = ground.heights(sample).take(sample.counted)
    rows = sample.counted[(height_m > OBSTACLE_M[0]) & (height_m < OBSTACLE_M[1])]
    x, y, z = sample.xyz.take(rows, axis=1)
    if T is not None:
        x, y = (T[k, 0] * x + T[k, 1] * y + T[k, 2] * z + T[k, 3] for k in (0, 1))
    bearing = ((np.arctan2(y, x) + np.pi) * (BEARINGS / (2 * np.pi))).astype(np.int64) % BEARINGS
    far = (np.log(np.maximum(np.hypot(x, y), NEAREST_M)) / LOG_STEP).astype(np.int64)
    return np.asarray((bearing * RANGES + far)[far < RANGES])


def _grown(cells: Int) -> Float64:
    """(BEARINGS, RANGES) 1 in occupied cells and beside them."""
    grid = np.zeros((BEARINGS, RANGES))
    grid.flat[cells] = 1.0
    grid = np.maximum(grid, np.maximum(np.roll(grid, 1, axis=0), np.roll(grid, -1, axis=0)))
    wide = grid.copy()
    wide[:, 1:] = np.maximum(wide[:, 1:], grid[:, :-1])
    wide[:, :-1] = np.maximum(wide[:, :-1], grid[:, 1:])
    return wide


def agreement(before: Sample, after: Sample, ground: GroundCheck, T_after_before: Float64) -> float:
    """Share of the obstacle points of a sweep that stand where the one before had some; 1 with too few points."""
    known = places(before, ground, T_after_before)
    cells = places(after, ground)
    if min(len(known), len(cells)) < MIN_POINTS:
        return 1.0
    return float(_grown(known).ravel().take(cells).mean())


def explain(before: Sample, after: Sample, ground: GroundCheck, T_after_before: Float64) -> tuple[Change, float]:
    """The change that brings most of the points of a sweep to known places, and their share."""
    known = places(before, ground, T_after_before)
    cells = places(after, ground)
    n = RANGES + 20
    wide = np.zeros((BEARINGS, n))
    wide[:, :RANGES] = _grown(known)
    spectrum = np.conj(np.fft.rfft2(wide))
    found = []
    for mirrored in (False, True):
        bearing, far = np.divmod(cells, RANGES)
        if mirrored:
            bearing = BEARINGS - 1 - bearing
        now = np.bincount(bearing * n + far, minlength=BEARINGS * n).reshape(BEARINGS, n).astype(np.float64)
        hits = np.fft.irfft2(spectrum * np.fft.rfft2(now), s=wide.shape) / max(len(cells), 1)
        scales = np.arange(n)
        scales[n // 2 :] -= n
        turned, column = np.divmod(int((hits - UNSCALED_FAVOUR * np.abs(scales)).argmax()), n)
        turned = (int(turned) + BEARINGS // 2) % BEARINGS - BEARINGS // 2
        found.append((Change(mirrored, turned, int(scales[column])), float(hits.max())))
    return max(found, key=lambda each: each[1])
