"""Roll, pitch and height of a sensor, measured by the floor in a sweep."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from modt.config import SensorConfig
from modt.geometry import rotation_zyx
from modt.geometry.field_of_view import BlindSectors
from modt.types import Float32, Float64

REACH_M = 12.0
"""Range within which the floor is searched [m]."""
DEPTH_M = 3.0
"""Greatest depth of a floor below the sensor [m]."""
WAY_M = 1.5
"""Half the width of the strip ahead and behind to which a floor is fitted [m]; a street slopes away beside it."""
CUBE_M = 0.25
"""Side of the cubes that count once each, as near returns are many [m]."""
MAX_CUBES = 2000
"""Greatest number of cubes in a search."""
TILTS_DEG = np.arange(-20.0, 20.1, 2.5)
"""Rolls and pitches that a search tries [deg]."""
BIN_M = 0.1
"""Resolution of the depth in a search [m]."""
NEAR_M = (0.25, 0.12, 0.08, 0.06)
"""Distance from the plane within which a cube counts in each round of the fit [m]."""
MIN_CUBES = 30
"""Fewest cubes on a floor."""
SIDE_M = 6.0
"""Range within which a floor goes on both ahead of the sensor and behind it [m]. The side of a hill does not."""
MIN_SIDE_SHARE = 0.1
"""Least share of the cubes ahead, and of those behind, that lie on such a floor; the others are objects."""
MIN_TILT_DEG = 2.0
"""Least tilt that is corrected [deg]: streets slope to their sides, and cars lean on their springs."""
OTHER_SHARE = 0.25
"""A plane whose depth differs from the height of the mount by this share of the height is no floor."""
HEIGHTS_M = (0.05, 5.0)
"""Least and greatest height that a profile can state [m]."""
UPSIDE_DOWN = np.diag([1.0, -1.0, -1.0])
LEVEL_UP = np.array([0.0, 0.0, 1.0])


@dataclass(frozen=True)
class Floor:
    """A floor below the sensor.

    Attributes:
        up: (3,) upward normal, sensor frame.
        depth_m: distance of the plane below the sensor, along the normal.
        cubes: number of cubes on the plane.
        around: whether the plane goes on both ahead of the sensor and behind it.
    """

    up: Float64
    depth_m: float
    cubes: int
    around: bool

    @property
    def roll_pitch_deg(self) -> tuple[float, float]:
        """Roll and pitch of the sensor, to a tenth."""
        x, y, z = self.up.tolist()
        return round(float(np.rad2deg(np.arctan2(y, z))), 1), round(float(np.rad2deg(-np.arcsin(x))), 1)

    def lies_at(self, height_m: float) -> bool:
        """Whether its depth is the height of a mount [m]."""
        return abs(self.depth_m - height_m) < OTHER_SHARE * height_m

    def tilt_deg(self, up: Float64 = LEVEL_UP) -> float:
        """Angle between the normal and the vertical (3,) of a mount, by default a level one."""
        return float(np.rad2deg(np.arccos(np.clip((up * self.up).sum(), -1.0, 1.0))))


def find_floor(points: Float32, height_m: float | None = None) -> Floor | None:
    """The floor in (N, 3) or wider points; None if no floor is in view.

    A ceiling looks like the floor of a sensor that hangs upside down. The floor is the plane whose depth is the
    height of the mount, else the one below the sensor, unless the one above is nearer and larger. A plane of another
    depth on one side of the sensor is the side of a hill.
    """
    near = points[np.hypot(points[:, 0], points[:, 1]) < REACH_M, :3]
    near = near[(near != 0).any(axis=1)]
    key = (np.floor(near / CUBE_M).astype(np.int64) * (1, 1_000, 1_000_000)).sum(axis=1)
    cubes = near[np.unique(key, return_index=True)[1]].astype(np.float64).T
    upright = _floor(cubes, np.eye(3))
    hanging = _floor(cubes, UPSIDE_DOWN)
    floor = upright or hanging
    if upright and hanging:
        if hanging.depth_m < upright.depth_m and hanging.cubes > upright.cubes:
            floor = hanging
        if height_m is not None and upright.lies_at(height_m) != hanging.lies_at(height_m):
            floor = upright if upright.lies_at(height_m) else hanging
    if floor is None or floor.around or height_m is None or floor.lies_at(height_m):
        return floor
    return None


def _floor(cubes: Float64, R: Float64) -> Floor | None:
    """Floor in (3, C) cubes; None without one. R (3, 3) turns the sensor upright, up to the angles of the search."""
    if cubes.shape[1] < MIN_CUBES:
        return None
    x, y, z = _turned(R, cubes[:, :: 1 + cubes.shape[1] // MAX_CUBES])
    turns = [_turn(roll_deg, pitch_deg) for roll_deg in TILTS_DEG for pitch_deg in TILTS_DEG]
    ups = np.array([turn[2] for turn in turns])
    depth = np.floor((ups[:, :1] * x + ups[:, 1:2] * y + ups[:, 2:] * z) / -BIN_M).astype(np.int64)
    bins = round(DEPTH_M / BIN_M)
    column = np.where(depth < 0, bins + 1, np.minimum(depth, bins)) + np.arange(len(ups))[:, None] * (bins + 2)
    count = np.bincount(column.ravel(), minlength=len(ups) * (bins + 2)).reshape(len(ups), -1)[:, : bins + 1]
    deeper = count[:, ::-1].cumsum(axis=1)[:, ::-1]
    score = count[:, :-2] + count[:, 1:-1] - deeper[:, 2:]  # nothing is below a floor
    best, bin_ = np.unravel_index(int(score.argmax()), score.shape)
    return _fitted(cubes, turns[best] @ R, float(BIN_M * (bin_ + 1)))


def _turn(roll_deg: float, pitch_deg: float) -> Float64:
    """(3, 3) rotation by a roll and a pitch."""
    return rotation_zyx(*np.deg2rad([roll_deg, pitch_deg, 0.0]))


def _fitted(cubes: Float64, R: Float64, depth_m: float) -> Floor | None:
    """Plane by least squares, from a first guess at a depth that is level after R (3, 3)."""
    x, y, z = _turned(R, cubes)
    way = np.abs(y) < WAY_M
    x = x[way]
    z = z[way]
    rows = np.stack([np.ones(len(z)), x, y[way]], axis=1)  # z = rows @ plane on the plane
    plane = np.array([-depth_m, 0.0, 0.0])
    n = 0
    for near_m in NEAR_M:
        near = np.abs(z - (rows * plane).sum(axis=1)) < near_m
        n = int(near.sum())
        if n < MIN_CUBES:
            return None
        used = rows[near]  # sums without BLAS, which would start threads
        normal_matrix = (used[:, :, None] * used[:, None]).sum(axis=0)
        right_side = (used * z[near, None]).sum(axis=0)
        plane = np.linalg.solve(normal_matrix, right_side)
    normal = np.array([-plane[1], -plane[2], 1.0])
    depth_m = -float(plane[0]) / float(np.linalg.norm(normal))
    if depth_m < HEIGHTS_M[0]:  # the level beams of a sensor in tall grass are a plane too, through the sensor
        return None
    sides = (side & (np.abs(x) < SIDE_M) for side in (x > 0.0, x < 0.0))
    around = all((side & near).sum() >= MIN_SIDE_SHARE * side.sum() for side in sides)
    return Floor(R.T @ (normal / np.linalg.norm(normal)), depth_m, n, around)


def _turned(R: Float64, columns: Float64) -> Float64:
    """(3, C) columns after a rotation (3, 3)."""
    return np.asarray((R[:, :, None] * columns[None]).sum(axis=1))


def ground_height_m(sweeps: Sequence[Float32], sensor: SensorConfig) -> float | None:
    """Median height above the floor in level sweeps of (N, 4) points [m]; None if no floor is in view."""
    sectors = BlindSectors(sensor.blind_sectors_deg or (), sensor.blind_range_m)
    heights_m = []
    for points in sweeps:
        kept = points[(np.hypot(points[:, 0], points[:, 1]) > sensor.min_range_m) & ~sectors.contain(points)]
        floor = find_floor(kept)
        if floor is not None and floor.up[2] > 0:
            heights_m.append(floor.depth_m)
    return float(np.median(heights_m)) if heights_m else None


def mount_height_m(sweeps: Sequence[Float32], sensor: SensorConfig) -> float | None:
    """Height above the floor as a value of sensor.height_m; None if unknown or out of the bounds of a profile."""
    height_m = ground_height_m(sweeps, sensor)
    return None if height_m is None or not HEIGHTS_M[0] <= height_m <= HEIGHTS_M[1] else round(height_m, 2)
