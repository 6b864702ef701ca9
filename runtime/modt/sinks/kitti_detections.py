"""KITTI tracking results of whole boxes."""

from __future__ import annotations

import numpy as np

from modt.types import Float64, Int


def result_lines(frame: Int, name: str, ids: Int, image_box: Float64, hwlxyzry: Float64, score: Float64) -> list[str]:
    """Lines of KITTI's tracking format, a score at the end.

    Args:
        frame: (n,) index of the frame.
        name: type of the objects.
        ids: (n,) of their tracks.
        image_box: (n, 4) left, top, right, bottom [pixel].
        hwlxyzry: (n, 7) h, w, l, x, y, z [m], ry [rad] in the camera's coordinates.
        score: (n,).
    """
    alpha = hwlxyzry[:, 6] - np.arctan2(hwlxyzry[:, 3], hwlxyzry[:, 5])
    alpha = (alpha + np.pi) % (2 * np.pi) - np.pi
    return [
        f"{f} {i} {name} 0 0 {a:.4f} {b[0]:.2f} {b[1]:.2f} {b[2]:.2f} {b[3]:.2f} "
        f"{d[0]:.4f} {d[1]:.4f} {d[2]:.4f} {d[3]:.4f} {d[4]:.4f} {d[5]:.4f} {d[6]:.4f} {s:.4f}\n"
        for f, i, a, b, d, s in zip(
            *(column.tolist() for column in (frame, ids, alpha, image_box, hwlxyzry, score)), strict=True
        )
    ]
