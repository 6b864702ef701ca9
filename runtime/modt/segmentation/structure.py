"""Long surfaces within a cluster: walls, fences, fronts of hedges and of shelves, sides of vehicles.

From above such a surface is a line. Lines are found one after the other in the cells that are not on a line yet: the
best of those through pairs of cells is fitted to the cells near it (least squares across the line), and long runs of
these cells are a surface.
"""

from __future__ import annotations

import numpy as np

from modt.segmentation.tuning import StructureTuning
from modt.types import Bool, Float32, Float64, Int

PAIRING_DIVISORS = 16, 3
"""Each cell of a sample of n is paired with the one about n / divisor after it: a close one, and a far one."""
Line = tuple[float, float, float]
"""Cosine and sine of the normal, and signed distance from the sensor to the line along it [m]."""


def find_surfaces(x: Float64, y: Float64, width_m: Float64, tuning: StructureTuning) -> tuple[Bool, Float64]:
    """(m,) cells on a surface, and (m,) distance of each before the surfaces that reach it [m].

    The distance is negative behind a surface, and infinite where none reaches.

    Args:
        x: (m,) a point of each cell of one cluster [m, sensor frame].
        y: (m,) the same.
        width_m: (m,) width of each cell across the ray [m].
        tuning: lines and runs that are a surface.
    """
    on_surface = np.zeros(len(x), np.bool_)
    before_m = np.full(len(x), np.inf)
    range_m = np.sqrt(x * x + y * y)
    for _ in range(tuning.max_lines):
        rest = np.flatnonzero(~on_surface)
        line = _best_line(x[rest], y[rest], tuning)
        if line is None:
            break
        cosine, sine, distance_m = line
        off_m = x * cosine + y * sine - distance_m
        along_m = y * cosine - x * sine
        near = rest[np.abs(off_m[rest]) < tuning.thickness_m]
        # A cell of the square root of range is twice as long along the ray as across it. along_m / range_m is the
        # cosine between the line and the ray.
        length_m = width_m * (1 + np.abs(along_m) / range_m)
        run = _long_runs(along_m[near], length_m[near], near, tuning)
        if not len(run):
            break
        on_surface[run] = True
        reaches = (along_m > along_m[run].min() - tuning.beside_m) & (along_m < along_m[run].max() + tuning.beside_m)
        towards_sensor_m = -off_m if distance_m > 0 else off_m
        before_m = np.where(reaches, np.minimum(before_m, towards_sensor_m), before_m)
    return on_surface, before_m


def _best_line(x: Float64, y: Float64, tuning: StructureTuning) -> Line | None:
    """Line near most of (m,) points, None without one."""
    if len(x) < tuning.min_cells:
        return None
    stride = -(-len(x) // tuning.max_cells)
    sample_x = x[::stride].astype(np.float32)
    sample_y = y[::stride].astype(np.float32)
    best: Line | None = None
    most = 0
    for divisor in PAIRING_DIVISORS:
        lines, near = _lines_through_pairs(sample_x, sample_y, len(sample_x) // divisor + 1, tuning)
        if near.max(initial=0) > most:
            most = int(near.max())
            cosine, sine, distance_m = lines[:, near.argmax()].tolist()
            best = cosine, sine, distance_m
    for _ in range(tuning.refinements):
        if best is not None:
            best = _refined(best, x, y, tuning.thickness_m)
    return best


def _lines_through_pairs(x: Float32, y: Float32, step: int, tuning: StructureTuning) -> tuple[Float32, Int]:
    """(3, k) lines through each of (n,) points and the one `step` after it, and (k,) points near each line."""
    other = (np.arange(len(x)) + step) % len(x)
    dx = x[other] - x
    dy = y[other] - y
    base_m = np.sqrt(dx * dx + dy * dy)
    usable = np.flatnonzero(base_m > np.float32(tuning.min_base_m))
    cosine = -dy[usable] / base_m[usable]
    sine = dx[usable] / base_m[usable]
    distance_m = x[usable] * cosine + y[usable] * sine
    off_m = x * cosine[:, None] + y * sine[:, None] - distance_m[:, None]
    near: Int = np.count_nonzero(np.abs(off_m) < np.float32(tuning.thickness_m), axis=1)
    return np.stack([cosine, sine, distance_m]), near


def _refined(line: Line, x: Float64, y: Float64, thickness_m: float) -> Line | None:
    """Line of the least squares of the points near one, None if they have no direction."""
    cosine, sine, distance_m = line
    near = np.abs(x * cosine + y * sine - distance_m) < thickness_m
    x, y = x[near], y[near]
    if not len(x):
        return None
    # Running sums add in order, as the compiled pass does.
    x_mean = x.cumsum()[-1] / len(x)
    y_mean = y.cumsum()[-1] / len(y)
    u = x - x_mean
    v = y - y_mean
    difference = (u * u - v * v).cumsum()[-1]
    product = 2 * (u * v).cumsum()[-1]
    scatter = np.sqrt(difference * difference + product * product)
    if not scatter > 0:
        return None
    # The normal is the direction of the least scatter; its doubled angle is opposite to that of the greatest.
    cosine = float(np.sqrt((1 - difference / scatter) / 2))
    sine = float(np.copysign(np.sqrt((1 + difference / scatter) / 2), -product))
    return cosine, sine, float(x_mean * cosine + y_mean * sine)


def _long_runs(along_m: Float64, length_m: Float64, cells: Int, tuning: StructureTuning) -> Int:
    """The cells that are part of a long run along a line.

    A short piece with a gap at both ends is no part of it: a person in a doorway.

    Args:
        along_m: (k,) position of each along the line [m].
        length_m: (k,) length of each along the line [m].
        cells: (k,) their numbers.
        tuning: length and gaps of a run.
    """
    if not len(cells):
        return cells
    order = along_m.argsort(kind="stable")
    at_m = along_m[order]
    length_m = length_m[order]
    gap_m = np.diff(at_m)
    ends = gap_m > tuning.max_gap_m
    run_m, run = _extents(at_m, ends)
    inside = np.flatnonzero(~ends)
    # A gap fills a run by at most two lengths of the cell before it. Below, the cell after it says whether it divides
    # pieces. Which of both cells is taken is arbitrary, since they are about as long.
    filled_m = np.bincount(run[inside], np.minimum(gap_m, 2 * length_m[:-1])[inside], len(run_m))
    long = (run_m >= tuning.min_length_m) & (filled_m >= tuning.min_filled * run_m)
    piece_m, piece = _extents(at_m, ends | (gap_m > tuning.piece_gap * length_m[1:]))
    return cells[order[long[run] & (piece_m[piece] >= tuning.min_piece_m)]]


def _extents(at_m: Float64, ends: Bool) -> tuple[Float64, Int]:
    """Extents of the groups into which (k,) sorted positions fall at (k - 1,) gaps, and (k,) group of each."""
    last = np.append(np.flatnonzero(ends), len(at_m) - 1)
    first = np.append(0, last[:-1] + 1)
    return at_m[last] - at_m[first], np.append(0, ends.cumsum())
