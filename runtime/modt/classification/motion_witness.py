"""The witness of a track: P(how far it went, how large it is | class), an expert beside network and box.

It is a state, not a view: it replaces itself in every frame and is never multiplied twice. A track went as far as
both of its ends did (`modt.tracking.extent`): where a changing part of a wall is seen, one of them moves.
"""

from __future__ import annotations

import numpy as np

from modt.class_sizes import MAX_SIZE_M
from modt.classes import N_CLASSES, ObjectClass
from modt.types import Float64, Int

YOUNG_S: Float64 = np.array((0.5, 1.5))
"""Ages [s] that part tracks which stay where they are."""
MOVED_M: Float64 = np.array((0.2, 0.5, 1.0, 2.0, 3.0, 5.0, 10.0))
"""Displacements [m] that part the others."""
LENGTH_M: Float64 = np.array((0.4, 1.3, 2.6))
"""Lengths [m] that part the tables. What is never seen longer than the first is a fragment."""
TOO_LARGE = 3.0
"""Log-likelihood that a cyclist loses where the track is larger than one; less: hidden cars are cyclists."""
CYCLIST_M: Float64 = 1.1 * MAX_SIZE_M[ObjectClass.CYCLIST]
"""Greatest length and width of a cyclist, who may once be seen together with something else [m]."""
LOG_LIKELIHOOD_RATIO: Float64 = (
    np.array(
        [
            [
                [-15, -15, -15, -15, -15, -15, -15, -15, -4, 15],
                [-10, -11, -15, -12, -9, -10, -12, -15, -15, -2],
                [-15, -15, -15, -15, -15, -9, -1, 6, 14, 15],
            ],
            [
                [-2, 2, 0, 2, 0, -1, -3, 6, 15, 15],
                [-11, -6, -3, -1, 5, 15, 15, -6, -15, -15],
                [-8, -15, -15, -1, 3, 9, 14, 15, 15, 15],
            ],
            [
                [-2, 0, 0, -4, -5, -3, 4, 10, 15, 10],
                [-9, -7, -3, -3, 2, 10, 14, 3, 4, -15],
                [-15, -15, -15, -12, -6, 1, 10, 15, 15, -2],
            ],
            [
                [-2, 0, 4, -2, -8, -12, -12, -7, 9, 15],
                [-8, -3, -2, -1, 1, 4, 5, -4, -6, -15],
                [-7, -15, -15, -11, -6, -3, 2, 8, 15, 13],
            ],
        ]
    )
    / 10.0
)
"""(4, 3, 10) log P(cell | class, length) / P(cell | background, length) by length, of car, pedestrian and cyclist.

That of fragments is of P(cell, length | class). Halved, since box and motion are not independent, and within 1.5; by
`python -m tools.train.motion_witness`.
"""

_BY_CLASS: Float64 = np.zeros((N_CLASSES, LOG_LIKELIHOOD_RATIO[:, 0].size))
"""(4, 40) the same of every class, 0 of one without a table, for each cell of each length in turn."""
_BY_CLASS[1 : 1 + LOG_LIKELIHOOD_RATIO.shape[1]] = np.concatenate([*LOG_LIKELIHOOD_RATIO], axis=1)


def cells(moved_m: Float64, observed_s: Float64, length_m: Float64) -> tuple[Int, Int]:
    """(R,) band of the length and (R,) cell of the motion: its displacement, or the age of what is still.

    Args:
        moved_m: (R,) displacement within about the last two seconds [m].
        observed_s: (R,) time since the first proposal [s].
        length_m: (R,) length of the track [m].
    """
    still = YOUNG_S.searchsorted(observed_s, side="right")
    gone = MOVED_M.searchsorted(moved_m, side="right") + len(YOUNG_S)
    return LENGTH_M.searchsorted(length_m, side="right"), np.where(moved_m < MOVED_M[0], still, gone)


def log_likelihood(moved_m: Float64, observed_s: Float64, size_m: Float64) -> Float64:
    """(R, 4) log P(motion, size | class) over that of background, 0 of a class without a table.

    Args:
        moved_m: (R,) displacement within about the last two seconds [m].
        observed_s: (R,) time since the first proposal [s].
        size_m: (R, 3) length, width and height of the track [m].
    """
    length, cell = cells(moved_m, observed_s, size_m[:, 0])
    out: Float64 = _BY_CLASS.take(length * LOG_LIKELIHOOD_RATIO.shape[2] + cell, axis=1)
    too_large = (size_m[:, 0] > CYCLIST_M[0]) | (size_m[:, 1] > CYCLIST_M[1])
    out[ObjectClass.CYCLIST] -= TOO_LARGE * too_large
    return out.T
