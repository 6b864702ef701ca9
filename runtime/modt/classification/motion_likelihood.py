"""Likelihood of the classes by the motion and the size of a track, evidence beside network and box.

It describes the present state of a track, not a view of it: each frame's value replaces the one before, and none is
counted twice. A track went as far as both of its ends did (`modt.tracking.extent`), since a partly hidden wall
seems to move as its visible part changes.
"""

from __future__ import annotations

import numpy as np

from modt.class_sizes import IS_RIDER, IS_VEHICLE, IS_WALKER, MAX_SIZE_M, USUAL_SIZE_M, USUAL_SPREAD_M
from modt.classes import N_CLASSES
from modt.classification.tuning import MotionTuning
from modt.types import Bool, Float64, Int

# Cells of the table, fixed when it was counted.
YOUNG_S: Float64 = np.array((0.5, 1.5))
"""Ages [s] that divide the tracks which stay where they are."""
MOVED_M: Float64 = np.array((0.2, 0.5, 1.0, 2.0, 3.0, 5.0, 10.0))
"""Displacements [m] that divide the others; a track stays where it is below the first."""
LENGTH_M: Float64 = np.array((0.4, 1.3, 2.6))
"""Lengths [m] that divide the tables. A track that was never longer than the first is a fragment."""
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
"""(4, 3, 10) log P(cell | class, length) over that of background, by length, of vehicle, walker and rider.

For fragments, the first length, the length itself is evidence too: P(cell, length | class). The values are halved,
since box and motion are not independent, and limited to 1.5. `python -m tools.train.motion_witness` counts them.
"""

_BY_CLASS: Float64 = np.zeros((N_CLASSES, LOG_LIKELIHOOD_RATIO[:, 0].size))
"""(C, 40) the table by class, and one after the other the cells of each length; 0 for other kinds."""
for of_kind, is_of_kind in enumerate((IS_VEHICLE, IS_WALKER, IS_RIDER)):
    _BY_CLASS[is_of_kind] = LOG_LIKELIHOOD_RATIO[:, of_kind].ravel()


def cells(moved_m: Float64, observed_s: Float64, length_m: Float64) -> tuple[Int, Int]:
    """(R,) band of the length, and (R,) cell of the motion: by the displacement, or by the age of what stays.

    Args:
        moved_m: (R,) displacement from the k-DOP lagged by about `ExtentTuning.lag_s` [m].
        observed_s: (R,) sum of the time steps that ended with a proposal [s].
        length_m: (R,) length of the track [m].
    """
    staying = YOUNG_S.searchsorted(observed_s, side="right")
    moving = MOVED_M.searchsorted(moved_m, side="right") + len(YOUNG_S)
    return LENGTH_M.searchsorted(length_m, side="right"), np.where(moved_m < MOVED_M[0], staying, moving)


class MotionLikelihood:
    """Likelihood of motion and size under each class.

    Seen whole from nearby, a vehicle is as long as its length, or, end-on, as its width. A length in between belongs
    to a stall, a bench or a heap.

    Args:
        tuning: penalties of sizes that a class does not have.
    """

    def __init__(self, tuning: MotionTuning) -> None:
        self._penalty = tuning.oversize_penalty
        self._max_length_m, self._max_width_m = tuning.oversize_ratio * MAX_SIZE_M[IS_RIDER].max(axis=0)
        spread_m = tuning.vehicle_deviations * USUAL_SPREAD_M
        self._widest_m = (USUAL_SIZE_M + spread_m)[:, 1, None]
        self._shortest_m = (USUAL_SIZE_M - spread_m)[:, 0, None]
        self._between_penalty = tuning.between_penalty * IS_VEHICLE[:, None]

    def log_ratio(self, moved_m: Float64, observed_s: Float64, size_m: Float64, is_whole: Bool) -> Float64:
        """(C, R) log P(motion, size | class) over that of background.

        Args:
            moved_m: (R,) displacement from the k-DOP lagged by about `ExtentTuning.lag_s` [m].
            observed_s: (R,) sum of the time steps that ended with a proposal [s].
            size_m: (R, 3) length, width and height of the track [m].
            is_whole: (R,) tracks that are near enough to show the whole object, and not cut at a side.
        """
        length_band, cell = cells(moved_m, observed_s, size_m[:, 0])
        ratio: Float64 = _BY_CLASS.take(length_band * LOG_LIKELIHOOD_RATIO.shape[2] + cell, axis=1)
        is_larger = (size_m[:, 0] > self._max_length_m) | (size_m[:, 1] > self._max_width_m)
        ratio[IS_RIDER] -= self._penalty * is_larger
        if is_whole.any():
            is_between = is_whole & (size_m[:, 0] > self._widest_m) & (size_m[:, 0] < self._shortest_m)
            ratio -= self._between_penalty * is_between
        return ratio
