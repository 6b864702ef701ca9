"""Whether sweeps were compensated for the motion of their sensor while its head turned, told by the scans alone.

    python -m tools.study.sweep_skew SCAN.bin [SCAN.bin ...]

A head fires at equal steps of bearing, whatever it meets. Compensation moves points, near and far alike, so at an
edge between near and far neighbours of a beam the bearing steps aside by the displacement times the difference of
1 / range. The displacement along the sensor's x [m] that this tells is zero to either side where nothing was
compensated. Where it was, and the car drove at v, it is -v T / 4 on the left and v T / 4 on the right if the head was
taken to turn clockwise, seen from above, once in T, its seam behind and the stamp ahead; if not, the other way round.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np

from modt.sources.scan_file import read_scan
from modt.types import Float32

WITHIN_DEG = 15.0
LEAST_RANGE_M = 3.0
EDGE = 0.02
"""Difference of 1 / range from which there is an edge [1/m]."""
FEWEST = 20
"""Edges."""


def displacement_m(points: Float32, bearing_deg: float) -> tuple[float, int]:
    """How far points (N, 4) in the order of their firing were moved along x, to the left (90) or the right (-90).

    Returns:
        The displacement, not a number where too little tells of it, and the number of edges.
    """
    bearing = np.rad2deg(np.arctan2(points[:, 1], points[:, 0], dtype=np.float64))
    range_m = np.hypot(points[:, 0], points[:, 1], dtype=np.float64)
    step, edge = np.diff(bearing), np.diff(1 / np.maximum(range_m, 1.0))
    chosen = (np.abs(bearing[:-1] - bearing_deg) < WITHIN_DEG) & (np.abs(step) < 3) & (np.abs(edge) > EDGE)
    chosen &= np.minimum(range_m[:-1], range_m[1:]) > LEAST_RANGE_M
    nearer, farther = chosen & (edge > 0), chosen & (edge < 0)
    n = int(min(nearer.sum(), farther.sum()))
    if n < FEWEST / 2:
        return np.nan, 2 * n
    slope = np.deg2rad(np.median(step[nearer]) - np.median(step[farther]))
    aside = slope / (np.median(edge[nearer]) - np.median(edge[farther]))
    return float(-aside * np.sin(np.deg2rad(bearing_deg))), int(chosen.sum())


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scans", type=Path, nargs="+", metavar="SCAN.bin")
    for path in parser.parse_args().scans:
        points, _ = read_scan(path)
        sides = [(name, *displacement_m(points, bearing)) for name, bearing in (("left", 90.0), ("right", -90.0))]
        print(path.name, *(f"{name} {moved:+.3f} m ({edges} edges)" for name, moved, edges in sides), sep="  ")


if __name__ == "__main__":
    main()
