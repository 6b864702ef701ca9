"""Plane of the ground near the sensor against the usual one, which the robot stands on."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from modt.trust.sample import Sample
from modt.trust.tuning import GroundTuning
from modt.types import Bool, Float64

HEIGHTS = 8.0
"""Reach of the plane [heights of the sensor], between REACH_M."""
REACH_M = (6.0, 15.0)
ROUNDS_M = (0.4, 0.2, 0.1)
"""Distance from the plane within which a point counts in each round of a fit [m]."""
MIN_POINTS = 40
"""Fewest sampled points on a plane."""
LOST_SHARE = 0.4
"""Share of the usual points on the ground below which the plane is sought elsewhere."""
TILTS_DEG = (-24.0, -16.0, -8.0, 0.0, 8.0, 16.0, 24.0)
SCALES = (*np.geomspace(0.25, 3.0, 22).tolist(), -1.0)
"""Tilts and shares of the height at which a lost plane is sought; below 0 it is above the sensor."""
SECTORS = 24
MOST_RINGS = 15
"""Cells in which the lowest points of two sweeps are compared: sectors, and rings of a metre."""
MIN_CELLS = 12
"""Fewest cells in which the ground of two sweeps is compared."""
STEP_ROUNDS = 3
"""Rounds of the fit of a step of the ground."""


@dataclass(frozen=True, slots=True)
class Plane:
    """z = plane @ (1, x, y); `points` sampled points lie on it."""

    plane: Float64
    points: int

    @property
    def up(self) -> Float64:
        """(3,) normal."""
        normal = np.array([-self.plane[1], -self.plane[2], 1.0])
        return np.asarray(normal / np.linalg.norm(normal))

    @property
    def height_m(self) -> float:
        """Height of the sensor above it [m], negative if it is above the sensor."""
        return float(-self.plane[0] * self.up[2])


class GroundCheck:
    """The usual plane of the ground. It is only followed while the plane is where it usually is.

    Args:
        tuning: what counts as another plane.
    """

    def __init__(self, tuning: GroundTuning, height_m: float | None) -> None:
        self._tuning = tuning
        self._height_m = height_m
        self.usual: Float64 | None = None
        self._points = 0.0  # usual number of sampled points on it
        self._last: tuple[Sample, Float64, Plane | None] | None = None  # the last fit, and to what
        self.lost = False  # whether the usual plane has few points in the last look

    def learn(self, sample: Sample, elapsed_s: float) -> None:
        """Follow the plane of a sweep."""
        if self.usual is None:
            found = self._search(sample, self.plane)
            if found is not None and found.height_m > 0:
                self.usual = found.plane
                self._points = found.points
            return
        found = self._fit(sample, self.usual)
        if found is None:
            return
        gain = min(elapsed_s / self._tuning.memory_s, 1.0)
        self.usual = np.asarray(self.usual + gain * (found.plane - self.usual))
        self._points += gain * (found.points - self._points)

    @property
    def plane(self) -> Float64:
        """(3,) the usual plane, that of the profile before any is known."""
        return np.array([-(self._height_m or 1.0), 0.0, 0.0]) if self.usual is None else self.usual

    def change(self, sample: Sample, share: float = 1.0) -> str:
        """Phrase for another plane than the usual one, empty if there is none within a share of the limits."""
        self.lost = False
        if self.usual is None or self._points < MIN_POINTS:
            return ""
        found = self._fit(sample, self.usual)
        if found is None or found.points < LOST_SHARE * self._points:
            self.lost = True
            found = self._search(sample, self.usual)
            if found is None or found.points < LOST_SHARE * self._points:
                return ""
        before = Plane(self.usual, 0)
        tilt_deg = float(np.rad2deg(np.arccos(np.clip(found.up @ before.up, -1.0, 1.0))))
        ratio = found.height_m / before.height_m
        if ratio < 0:
            return "the ground is above the sensor"
        if tilt_deg > share * self._tuning.tilt_deg:
            return f"the ground is tilted by {tilt_deg:.0f} deg against the mount"
        if abs(ratio - 1) > share * self._tuning.height_share:
            return f"the ground is {found.height_m:.2f} m below the sensor, not {before.height_m:.2f}"
        return ""

    def step(self, pairs: Sequence[tuple[Sample, Sample]]) -> Float64 | None:
        """Plane (3,) by which the ground moved at once, between two samples of a pair; None if it did not."""
        if self.usual is None:
            return None
        reach_m = _reach_m(self.usual)
        steps = (_step(_lowest(before, reach_m), _lowest(after, reach_m)) for before, after in pairs)
        return next((step for step in steps if step is not None and self.is_step(step)), None)

    def is_step(self, plane: Float64) -> bool:
        """Whether a plane (3,) differs from none by more than the limits."""
        assert self.usual is not None
        tilt_deg = np.rad2deg(np.arctan(np.hypot(plane[1], plane[2])))
        limit_m = self._tuning.height_share * abs(self.usual[0])
        return bool(tilt_deg > self._tuning.tilt_deg or abs(plane[0]) > limit_m)

    def _near(self, sample: Sample, plane: Float64) -> tuple[Float64, Float64]:
        """(3, k) rows 1, x, y and (k,) z of the points near the sensor."""
        reach_m = _reach_m(plane)
        rows = sample.counted[sample.range_m.take(sample.counted) < reach_m]
        x, y, z = sample.xyz.take(rows, axis=1).astype(np.float64)
        return np.stack([np.ones(len(x)), x, y]), z

    def _fit(self, sample: Sample, plane: Float64) -> Plane | None:
        """Plane by least squares from a first guess; None if too few points lie on it."""
        if self._last is None or self._last[0] is not sample or self._last[1] is not plane:
            columns, z = self._near(sample, plane)
            self._last = sample, plane, _fitted(columns, z, plane)
        return self._last[2]

    def _search(self, sample: Sample, usual: Float64) -> Plane | None:
        """The plane with the most points among tilts and heights around the usual one."""
        columns, z = self._near(sample, usual)
        if len(z) < MIN_POINTS:
            return None
        slopes = np.tan(np.deg2rad(TILTS_DEG))
        tilts = np.stack(np.meshgrid(slopes, slopes), axis=-1).reshape(-1, 2)
        best = None
        for scale in SCALES:
            level = usual * np.array([scale, np.sign(scale), np.sign(scale)])
            offset = z - (tilts + level[1:]) @ columns[1:] - level[0]
            on = (np.abs(offset) < ROUNDS_M[1]).sum(axis=1)
            k = int(on.argmax())
            if best is None or on[k] > best[0]:
                best = (int(on[k]), np.array([level[0], *(tilts[k] + level[1:])]))
        return None if best is None else _fitted(columns, z, best[1])


def _fitted(columns: Float64, z: Float64, plane: Float64) -> Plane | None:
    n = 0
    for round_m in ROUNDS_M:
        on: Bool = np.abs(z - plane @ columns) < round_m
        n = int(np.count_nonzero(on))
        if n < MIN_POINTS:
            return None
        plane = _least_squares(columns[:, on], z[on])
    return Plane(plane, n)


def _step(before_m: Float64, after_m: Float64) -> Float64 | None:
    """Plane (3,) by which most of the lowest points (n,) of the cells moved; None if too few cells have both."""
    both = np.flatnonzero(np.isfinite(before_m) & np.isfinite(after_m))
    if len(both) < MIN_CELLS:
        return None
    columns = _CELLS[:, both]
    step_m = after_m[both] - before_m[both]
    plane = np.zeros(3)
    for _ in range(STEP_ROUNDS):
        off_m = np.abs(step_m - plane @ columns)
        used = off_m <= 2 * np.median(off_m)
        plane = _least_squares(columns[:, used], step_m[used])
    return plane


def _least_squares(columns: Float64, values: Float64) -> Float64:
    """(3,) factors of the columns (3, k) that make the values (k,)."""
    return np.asarray(np.linalg.solve(columns @ columns.T + 1e-6 * np.eye(3), columns @ values), np.float64)


def _reach_m(plane: Float64) -> float:
    """Range within which points belong to the ground near the sensor [m]."""
    return float(np.clip(HEIGHTS * abs(plane[0]), *REACH_M))


def _cell_centres() -> Float64:
    """(3, n) rows 1, x, y of the centres of the cells."""
    bearing = (np.arange(SECTORS) + 0.5) * (2 * np.pi / SECTORS) - np.pi
    range_m = np.arange(MOST_RINGS) + 0.5
    x = np.outer(np.cos(bearing), range_m).ravel()
    y = np.outer(np.sin(bearing), range_m).ravel()
    return np.stack([np.ones(len(x)), x, y])


_CELLS = _cell_centres()


def _lowest(sample: Sample, reach_m: float) -> Float64:
    """(n,) height of the lowest point of each cell [m], infinite without one."""
    rows = sample.counted[sample.range_m.take(sample.counted) < reach_m]
    x, y, z = sample.xyz.take(rows, axis=1)
    sector = ((np.arctan2(y, x) + np.pi) * (SECTORS / (2 * np.pi))).astype(np.int64) % SECTORS
    lowest = np.full(SECTORS * MOST_RINGS, np.inf)
    np.minimum.at(lowest, sector * MOST_RINGS + sample.range_m.take(rows).astype(np.int64), z)
    return lowest
