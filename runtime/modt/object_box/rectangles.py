"""Rectangles about the points of proposals."""

from __future__ import annotations

import numpy as np

from modt.geometry.kernels import GeometryKernels
from modt.object_box.tuning import HeadingTuning
from modt.object_box.vectors import left_of
from modt.types import Float32, Float64, Int, Proposals

_HEADINGS_RAD = np.deg2rad(np.arange(0, 90, 5.0))
HEADINGS: Float64 = np.stack([np.cos(_HEADINGS_RAD), np.sin(_HEADINGS_RAD)], axis=1)
"""(H, 2) unit vectors of the headings at which rectangles are fitted; the compiled pass has room for 32."""
SIDES: Float32 = np.concatenate([HEADINGS.T, [-HEADINGS[:, 1], HEADINGS[:, 0]]], axis=1).astype(np.float32)
"""(2, 2 H) x and y of the headings, then of what lies to the left of them."""


def fitted(
    proposals: Proposals,
    of_rows: Int,
    forward: tuple[float, float],
    kernels: GeometryKernels,
    tuning: HeadingTuning,
) -> tuple[Float64, Float64]:
    """Rectangles whose sides the points of proposals (R,) are closest to, at one of HEADINGS.

    As in the segmentation, but by points in place of cells, and by more of them.

    Returns:
        long_side: (R, 2) unit vectors along the longer sides [world].
        sides_m: (2, R) longer and shorter sides [m].
    """
    first = proposals.offsets[of_rows]
    # Every stride-th point of a proposal; divisions are rounded up.
    stride = -(-(proposals.offsets[of_rows + 1] - first) // tuning.max_fit_points)
    count = -(-(proposals.offsets[of_rows + 1] - first) // stride)
    starts = count.cumsum() - count
    rank = np.arange(count.sum()) - starts.repeat(count)
    points = first.repeat(count) + rank * stride.repeat(count)
    c, s = SIDES[:, :, None]
    along = c * proposals.coordinates[0, points] + s * proposals.coordinates[1, points]
    low, high = (of.reduceat(along, starts, axis=1).repeat(count, axis=1) for of in (np.minimum, np.maximum))
    inward = np.minimum(along - low, high - along)
    nearest = np.minimum(inward[: len(HEADINGS)], inward[len(HEADINGS) :])
    closeness = 1 / np.maximum(nearest, np.float32(tuning.side_noise_m))
    best = np.add.reduceat(closeness, starts, axis=1, dtype=np.float64).argmax(axis=0)
    heading = HEADINGS[best]
    low, high = extent(proposals, of_rows, heading, kernels)
    sides_m = high - low
    across = sides_m[0] < sides_m[1]
    side = np.where(across[:, None], left_of(heading), heading)
    x, y = forward
    long_side = np.stack([side[:, 0] * x - side[:, 1] * y, side[:, 0] * y + side[:, 1] * x], axis=1)
    return long_side, np.stack([sides_m.max(axis=0), sides_m.min(axis=0)])


def extent(proposals: Proposals, of_rows: Int, heading: Float64, kernels: GeometryKernels) -> tuple[Float64, Float64]:
    """(2, R) least, and greatest coordinates of proposals (R,) along headings (R, 2), and to the left of them."""
    runs = np.stack([proposals.offsets[of_rows], proposals.offsets[of_rows + 1]])
    count = runs[1] - runs[0]
    _, (x, y, _) = kernels.copy_runs(proposals.members, proposals.coordinates, runs)
    c, s = heading.astype(np.float32).repeat(count, axis=0).T
    starts = count.cumsum() - count
    along = np.stack([x * c + y * s, y * c - x * s])
    least, greatest = (of.reduceat(along, starts, axis=1).astype(np.float64) for of in (np.minimum, np.maximum))
    return least, greatest
