"""Slope of the floor in one sweep, a few degrees around what is expected, and its change during the sweep."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from modt.types import Bool, Float64

REACH_M = 12.0
"""Range within which the floor is searched [m]."""
SLOPES = np.deg2rad(np.arange(-20.0, 20.1, 2.5))
"""Slopes along x and along y that are tried around the expected ones."""
TRIED_M = 0.15
"""Distance from a tried plane at the sensor within which a point counts [m]; farther below, it counts against."""
TRIED_SLOPE = 0.02
"""Growth of that distance with range."""
MAX_TRIED = 200
"""Greatest number of points by which planes are tried."""
NEAR_M = 0.04
"""Distance from the fitted plane within which a point belongs to the floor at the sensor [m]."""
NEAR_SLOPES = (0.05, 0.03, 0.015, 0.01)
"""Growth of that distance with range in each round of the fit."""
MIN_POINTS = 60
"""Fewest points of a floor."""
NOISE_M = 0.04
"""Distance of the points of a floor from its plane [m], by which the error of a slope is judged."""
MAX_ERROR = np.deg2rad(0.7)
"""Greatest standard deviation of a slope that is used."""
MAX_RATE_PER_S = 1.0
"""Slopes change at most about as fast [1/s]. A floor that shows less of its change is taken to be steadier."""
MAX_BEND_PER_S2 = 8.0
"""Half the change of that change is at most about as great [1/s2]; 6 degrees at 2 Hz reach it."""
MAX_BELOW_SHARE = 0.15
"""Greatest number of points below a floor over that of the points on it."""


@dataclass(frozen=True)
class FloorSlope:
    """The floor z = -depth_m - slope . (x, y), and its change with the time from the stamp.

    Attributes:
        slope: (2,) along x and y, positive where the floor falls; these are x and y of the upward normal over its z.
        twist: (2, 2) its rate along x and y at the stamp [1/s], and half the change of the rate [1/s2]. A robot that
            walks turns back within a sweep.
        depth_m: depth below the sensor.
    """

    slope: Float64
    twist: Float64
    depth_m: float


def floor_slope(xyz: Float64, delay_s: Float64, expected: Float64, depth_m: float) -> FloorSlope | None:
    """The floor in (3, N) points seen at (N,) delays after the stamp; None where it does not show.

    Args:
        xyz: points of a sensor turned about level [m].
        delay_s: times after the stamp.
        expected: (2,) slope around which the floor is searched.
        depth_m: expected depth.
    """
    x, y, z = xyz
    range_m = np.hypot(x, y)
    kept = (range_m < REACH_M) & (z < 0.5 * range_m)
    if np.count_nonzero(kept) < MIN_POINTS:
        return None
    x = x[kept]
    y = y[kept]
    delay_s = delay_s[kept]
    range_m = range_m[kept]
    fall = -z[kept]  # on the floor it is plane . rows
    rows = np.stack([np.ones(len(x)), x, y, delay_s * x, delay_s * y, delay_s**2 * x, delay_s**2 * y])
    plane = np.zeros(7)
    plane[0] = depth_m
    few = slice(None, None, 1 + len(x) // MAX_TRIED)
    plane[1:3] = _tried(rows[1:3, few], fall[few] - depth_m, TRIED_M + TRIED_SLOPE * range_m[few], expected)
    return _fitted(rows, fall, range_m, plane)


def _fitted(rows: Float64, fall: Float64, range_m: Float64, plane: Float64) -> FloorSlope | None:
    """The floor by least squares, from a tried plane (7,); None if too few points lie on it, or too many below.

    Args:
        rows: (7, n) of the points: 1, x, y, and x and y times the delay and its square.
        fall: (n,) depth of the points, which is plane . rows on the floor.
        range_m: (n,) range of the points.
        plane: depth, slopes along x and y, their rates, and half the changes of the rates.
    """
    # Each value is taken to be 0 with a deviation of 1, MAX_RATE or MAX_BEND, which holds what the points leave open.
    prior = np.full(7, NOISE_M**2)
    prior[3:5] /= MAX_RATE_PER_S**2
    prior[5:] /= MAX_BEND_PER_S2**2
    normal = np.diag(prior)
    near: Bool = np.zeros(len(fall), np.bool_)
    for growth in NEAR_SLOPES:
        near = np.abs(_below_m(rows, fall, plane)) < NEAR_M + growth * range_m
        if np.count_nonzero(near) < MIN_POINTS:
            return None
        used = rows[:, near]
        normal = np.einsum("in,jn->ij", used, used) + np.diag(prior)  # without BLAS, which would start threads
        plane = np.linalg.solve(normal, np.einsum("in,n->i", used, fall[near]))
    error = NOISE_M * np.sqrt(np.diag(np.linalg.inv(normal))[1:3])
    below = _below_m(rows, fall, plane) > 3 * (NEAR_M + NEAR_SLOPES[-1] * range_m)
    if error.max() > MAX_ERROR or np.count_nonzero(below) > MAX_BELOW_SHARE * np.count_nonzero(near):
        return None
    return FloorSlope(plane[1:3], plane[3:].reshape(2, 2), float(plane[0]))


def _below_m(rows: Float64, fall: Float64, plane: Float64) -> Float64:
    """(n,) distance of the points below a plane [m]."""
    return np.asarray(fall - np.einsum("i,in->n", plane, rows))


def _tried(across: Float64, fall: Float64, tolerance_m: Float64, expected: Float64) -> Float64:
    """(2,) slope of the tried plane on which most points lie, less those below it.

    Args:
        across: (2, n) x and y of points.
        fall: (n,) their depth below the plane of slope 0.
        tolerance_m: (n,) greatest distance from the plane.
        expected: (2,) slope around which planes are tried.
    """
    x_slopes, y_slopes = expected[:, None] + SLOPES
    off_m = (fall - x_slopes[:, None] * across[0])[:, None] - y_slopes[:, None] * across[1]  # (S, S, n)
    score = (off_m > -tolerance_m).sum(axis=2) - 2 * (off_m > tolerance_m).sum(axis=2)
    i, j = np.unravel_index(int(score.argmax()), score.shape)
    return np.array([x_slopes[i], y_slopes[j]])
