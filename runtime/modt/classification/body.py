"""The body of a person in a proposal that shows more: a load, a child on the shoulders, a rest of what hangs above.

The network takes the greatest of each feature over all points. So a few points that no person has make a person
background, until only the points of the body are looked at.
"""

from __future__ import annotations

import numpy as np

from modt.classification.crops import Crops
from modt.classification.tuning import BodyTuning
from modt.types import Bool, Float32, Float64, Int


def may_hold_more(box: Float64, ground_z_m: Float64, tuning: BodyTuning) -> Bool:
    """(R,) proposals that are larger than a person, and small enough to be one who carries something.

    Args:
        box: (R, 7) their boxes.
        ground_z_m: (R,) z of the ground beneath each [m].
        tuning: sizes.
    """
    length_m = box[:, 3]
    top_m = box[:, 2] + box[:, 5] / 2 - ground_z_m
    larger: Bool = (length_m > tuning.usual_length_m) | (top_m > tuning.usual_top_m)
    return larger & (length_m < tuning.max_length_m) & (top_m < tuning.max_top_m)


def bodies(crops: Crops, ground_z_m: Float64, rows: Int, tuning: BodyTuning) -> tuple[Int, Crops]:
    """(B,) those of the rows whose points may show the body of a person, and the points of these bodies.

    A body stands around the middle of the points at the height of legs and hips.

    Args:
        crops: points of R proposals in the sensor frame.
        ground_z_m: (R,) z of the ground beneath each [m].
        rows: (K,) proposals to look at.
        tuning: size of a body, and how much of it has to be shown.
    """
    tried = crops.select(rows)
    owner = np.arange(len(rows)).repeat(tried.count)
    height_m = tried.xyz[:, 2] - ground_z_m[rows].repeat(tried.count)
    aside_m2 = _aside_m2(tried.xyz, height_m, owner, len(rows), tuning)
    inside = (aside_m2 < tuning.radius_m**2) & (height_m < tuning.top_m)
    shown = _is_shown(height_m[inside], owner[inside], tried.count, tuning)
    of_shown = inside & shown[owner]
    n_points = np.bincount(owner[of_shown], minlength=len(rows))[shown]
    return rows[shown], Crops(tried.xyz[of_shown], np.append(0, n_points.cumsum()))


def _aside_m2(xyz: Float32, height_m: Float64, owner: Int, n: int, tuning: BodyTuning) -> Float64:
    """(P,) squared distance of each point from the middle of the legs of its owner [m²], NaN where none are seen."""
    leg = np.flatnonzero((height_m > tuning.min_leg_m) & (height_m < tuning.max_leg_m))
    aside_m2 = np.zeros(len(owner))
    for axis in (0, 1):
        middle_m = _medians(xyz[leg, axis], owner[leg], n)
        aside_m2 += np.square(xyz[:, axis] - middle_m[owner])
    return aside_m2


def _is_shown(height_m: Float64, owner: Int, n_points: Int, tuning: BodyTuning) -> Bool:
    """(K,) whether the points inside a body, by their owner, are a person's, of (K,) points of the proposal."""
    n_inside = np.bincount(owner, minlength=len(n_points))
    low_m = np.full(len(n_points), np.inf)
    high_m = np.full(len(n_points), -np.inf)
    np.minimum.at(low_m, owner, height_m)
    np.maximum.at(high_m, owner, height_m)
    is_shown: Bool = n_inside >= np.maximum(tuning.min_points, tuning.min_share * n_points)
    is_shown &= high_m - low_m > tuning.min_height_m
    return is_shown


def _medians(values: Float32, owner: Int, n: int) -> Float64:
    """(n,) middle values by their owner, the upper one of two; NaN without values. The owners ascend."""
    count = np.bincount(owner, minlength=n)
    order = np.lexsort((values, owner))
    middle = count.cumsum() - count + count // 2
    medians = np.full(n, np.nan)
    medians[count > 0] = values[order[middle[count > 0]]]
    return medians
