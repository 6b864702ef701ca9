"""Test whether sweeps are motion-compensated (deskewed), from the scans alone.

    python -m tools.study.sweep_skew SCAN.bin [SCAN.bin ...]

The azimuth steps of a beam are equal. Compensation displaces near and far points equally, so at a range edge between
neighbours of a beam the azimuth step changes by the displacement times the difference of 1 / range. The displacement
along the sensor's x axis [m] estimated from such edges is zero on both sides in raw sweeps. In compensated sweeps of
a vehicle at speed v it is -v T / 4 on the left and v T / 4 on the right for a head that turns clockwise, seen from
above, once in T, with the sweep's ends behind and its stamp ahead; for the other direction the signs are reversed.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from modt.sources.scan_file import read_scan
from modt.types import Float32
from tools.options import parser

WITHIN_DEG = 15.0
MIN_RANGE_M = 3.0
MIN_EDGE_PER_M = 0.02
"""Minimum difference of 1 / range at an edge [1/m]."""
MIN_EDGES = 20


def displacement_m(points: Float32, bearing_deg: float) -> tuple[float, int]:
    """Displacement along x of points (N, 4) in firing order, to the left (bearing 90) or the right (-90).

    Returns:
        The displacement [m], NaN with fewer than MIN_EDGES edges, and the number of edges.
    """
    bearing = np.rad2deg(np.arctan2(points[:, 1], points[:, 0], dtype=np.float64))
    range_m = np.hypot(points[:, 0], points[:, 1], dtype=np.float64)
    step, edge = np.diff(bearing), np.diff(1 / np.maximum(range_m, 1.0))
    chosen = (np.abs(bearing[:-1] - bearing_deg) < WITHIN_DEG) & (np.abs(step) < 3) & (np.abs(edge) > MIN_EDGE_PER_M)
    chosen &= np.minimum(range_m[:-1], range_m[1:]) > MIN_RANGE_M
    nearer, farther = chosen & (edge > 0), chosen & (edge < 0)
    n = int(min(nearer.sum(), farther.sum()))
    if n < MIN_EDGES / 2:
        return np.nan, 2 * n
    slope = np.deg2rad(np.median(step[nearer]) - np.median(step[farther]))
    aside = slope / (np.median(edge[nearer]) - np.median(edge[farther]))
    return float(-aside * np.sin(np.deg2rad(bearing_deg))), int(chosen.sum())


def main() -> None:
    options = parser(__doc__)
    options.add_argument("scans", type=Path, nargs="+", metavar="SCAN.bin")
    for path in options.parse_args().scans:
        points, _ = read_scan(path)
        sides = [(name, *displacement_m(points, bearing)) for name, bearing in (("left", 90.0), ("right", -90.0))]
        print(path.name, *(f"{name} {moved:+.3f} m ({edges} edges)" for name, moved, edges in sides), sep="  ")


if __name__ == "__main__":
    main()
