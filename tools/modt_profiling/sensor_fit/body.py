"""The robot's body, as far as its sensor sees it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from modt.types import Bool, Float32, Float64, Int

CELL_DEG = 2.0
COLUMNS = int(360 / CELL_DEG)
BODY_REACH_M = 3.0  # greatest distance of a part of the robot from its sensor
STEADY_M = 0.03  # range of a fixed cell changes by less, from the 10 % to the 90 % quantile
MIN_SHARE = 0.8  # least share of the sweeps in which a fixed cell has a return
MIN_CLEARANCE_M = 0.3  # least height above the ground
MAX_ABOVE_M = 1.0  # greatest height above the sensor: a ceiling is higher
MAX_FIXED_SHARE = 0.5  # greatest share of fixed cells out of reach, in a recording that moves
# added around the visible parts
MARGIN_DEG = 1.0
MARGIN_M = 0.2
JOIN_DEG = 6.0  # sectors nearer than this are one
MIN_SWEEPS = 5


@dataclass(frozen=True)
class Body:
    """Visible parts of the robot."""

    sectors_deg: Float64  # (S, 2) from, to, counter-clockwise
    range_m: float  # range of the farthest part


def find_body(sweeps: Sequence[Float32], height_m: float) -> Body | None:
    """Cells near the sensor and above the ground that stay where they are; None if the recording cannot tell.

    Args:
        sweeps: (N, 4) points of each, some time apart.
        height_m: height of the sensor above the ground.
    """
    if len(sweeps) < MIN_SWEEPS:
        return None
    nearest = np.stack([_nearest(points) for points in sweeps])
    seen = np.isfinite(nearest).mean(axis=0) > MIN_SHARE
    cells = np.flatnonzero(seen)
    # A cell is fixed where its range hardly varies: what moves with the sensor is a part of the robot.
    low, range_m, high = np.nanquantile(
        np.where(np.isfinite(nearest), nearest, np.nan)[:, cells], [0.1, 0.5, 0.9], axis=0
    )
    fixed = high - low < STEADY_M
    elevation = np.deg2rad((cells // COLUMNS + 0.5) * CELL_DEG - 90)
    rise_m = range_m * np.tan(elevation)
    clear = (rise_m > MIN_CLEARANCE_M - height_m) & (rise_m < MAX_ABOVE_M)
    # Where much beyond the robot's reach is fixed too, the recording stands still, and tells nothing.
    away = (range_m > BODY_REACH_M) & clear
    if not away.any() or fixed[away].mean() > MAX_FIXED_SHARE:
        return None
    on_robot = fixed & clear & (range_m < BODY_REACH_M)
    if not on_robot.any():
        return Body(np.zeros((0, 2)), 0.0)
    column: Bool = np.zeros(COLUMNS, np.bool_)
    column[cells[on_robot] % COLUMNS] = True
    return Body(_sectors(column), float(range_m[on_robot].max()) + MARGIN_M)


def _nearest(points: Float32) -> Float64:
    """Nearest horizontal range in each cell of elevation and azimuth [m], infinite where there is none."""
    range_m = np.hypot(points[:, 0], points[:, 1])
    row = ((np.rad2deg(np.arctan2(points[:, 2], range_m)) + 90) // CELL_DEG).astype(np.int64)
    column: Int = (np.rad2deg(np.arctan2(points[:, 1], points[:, 0])) % 360 // CELL_DEG).astype(np.int64) % COLUMNS
    out = np.full(COLUMNS // 2 * COLUMNS + COLUMNS, np.inf)
    np.minimum.at(out, row * COLUMNS + column, range_m)
    return out


def _sectors(column: Bool) -> Float64:
    """(S, 2) bounds of runs of columns around the circle [deg], from -180 to 180."""
    if column.all():
        return np.array([[-180.0, 180.0]])
    # Turn the circle so that it begins outside a run: no run then goes over its end.
    start = int(np.argmin(column))
    turned = np.roll(column, -start)
    edges = np.flatnonzero(np.diff(np.concatenate([[False], turned, [False]]).astype(np.int8))).reshape(-1, 2)
    gap = np.diff(edges.ravel())[1::2] * CELL_DEG
    apart = gap > JOIN_DEG
    first = edges[np.append(True, apart), 0]
    last = edges[np.append(apart, True), 1]
    bounds = (np.stack([first, last], axis=1) + start) * CELL_DEG + [-MARGIN_DEG, MARGIN_DEG]
    return np.asarray((bounds + 180) % 360 - 180)
