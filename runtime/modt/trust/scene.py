"""What stood still must stand where the pose says: obstacles of two sweeps in one log-polar grid.

A turn of the sensor shifts the grid along the bearing, a scale of the ranges along the logarithm of the range, and a
mirror reverses the bearing (Fourier-Mellin).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from modt.geometry import inverse, rotation_zyx, se3
from modt.trust.sample import Sample
from modt.types import Bool, Float64, Int

BEARINGS = 72
LOG_STEP = 0.08
"""Width of a cell in the logarithm of the range."""
NEAREST_M = 1.0
"""Range of the first cell [m]."""
RANGES = 50
"""Cells along the range, up to 54 m."""
MIN_POINTS = 40
"""Fewest obstacle points in which a scene is compared."""
VANISHED = 3
"""Obstacles that were so many times MIN_POINTS, and are below it, have vanished."""
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


def places(sample: Sample, plane: Float64, T: Float64 | None = None) -> Int:
    """(k,) cells of the obstacle points above a ground (3,), brought into another sensor frame by T (4, 4)."""
    x, y, z = sample.obstacles(plane)
    if T is not None:
        a = T.astype(np.float32)
        x, y = (a[k, 0] * x + a[k, 1] * y + a[k, 2] * z + a[k, 3] for k in (0, 1))
    bearing = ((np.arctan2(y, x) + np.float32(np.pi)) * np.float32(BEARINGS / (2 * np.pi))).astype(np.int64)
    far = (np.log(np.maximum(x * x + y * y, NEAREST_M)) * np.float32(0.5 / LOG_STEP)).astype(np.int64)
    return np.asarray((bearing % BEARINGS * RANGES + far)[far < RANGES])


def _grown(cells: Int) -> Bool:
    """(BEARINGS, RANGES) occupied cells, and those beside them."""
    grid = np.zeros((BEARINGS + 2, RANGES), np.bool_)
    grid[1:-1].flat[cells] = True
    grid[0] = grid[-2]
    grid[-1] = grid[1]
    wide: Bool = grid[1:-1] | grid[:-2] | grid[2:]
    grown = wide.copy()
    grown[:, 1:] |= wide[:, :-1]
    grown[:, :-1] |= wide[:, 1:]
    return grown


def agreement(before: Sample, after: Sample, plane: Float64, T_after_before: Float64) -> float:
    """Share of the obstacle points of a sweep that stand where the one before had some; 1 with too few."""
    known = places(before, plane, T_after_before)
    cells = places(after, plane)
    if len(known) > VANISHED * MIN_POINTS > VANISHED * len(cells):
        return 0.0
    if min(len(known), len(cells)) < MIN_POINTS:
        return 1.0
    return float(_grown(known).ravel().take(cells).mean())


def explain(before: Sample, after: Sample, plane: Float64, T_after_before: Float64) -> tuple[Change, float]:
    """The change that brings most of the points of a sweep to known places, and their share."""
    known = places(before, plane, T_after_before)
    cells = places(after, plane)
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
