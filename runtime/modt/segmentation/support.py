"""What proposals stand on: the ground that is seen, or a platform above it."""

from __future__ import annotations

import numpy as np

from modt.segmentation.tuning import SupportTuning
from modt.types import Float64, Int


def support_z_m(ground_z_m: Float64, box: Float64, count: Int, tuning: SupportTuning) -> Float64:
    """(P,) z of what each proposal stands on [m, sensor frame].

    From below, the top of a dock, a stage or a raised pavement is hardly seen, and no ray that crosses its edge finds
    the ground again. Who stands there reaches higher than a person does, and begins higher than feet do. Such a
    proposal stands at its lowest point.

    Args:
        ground_z_m: (P,) z of the ground beneath each [m, sensor frame].
        box: (P, 7) boxes in the sensor frame.
        count: (P,) numbers of points.
        tuning: size and place of who may stand there.
    """
    bottom_z_m = box[:, 2] - box[:, 5] / 2
    step_m = bottom_z_m - ground_z_m
    extent_m = np.hypot(box[:, 3], box[:, 4])
    raised = tuning.person.fits(extent_m, step_m, step_m + box[:, 5]) & (count >= tuning.min_points)
    raised &= (step_m > tuning.min_step_m) & (step_m < tuning.max_step_m)
    return np.where(raised, bottom_z_m, ground_z_m)
