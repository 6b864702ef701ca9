"""People within a cluster that is more than one object: who stands beside another or a column, or pushes something.

From above, a head is a narrow peak of the heights of the cells. Between two heads the heights dip to the shoulders.
The cells around a head are the person below it.
"""

from __future__ import annotations

import numpy as np

from modt.segmentation.tuning import HeadTuning
from modt.types import NONE, Bool, Float32, Float64, Int

BINS = 5
"""Parts of the corridor between two peaks, each of which has a greatest height."""
CORRIDOR_SHARES = 0.2, 0.8
"""Share of the way between two peaks at which the corridor begins, and at which it ends."""
CORRIDOR_HALF_WIDTH_M = 0.3
"""Half the width of the corridor [m]."""


def find_people(x: Float32, y: Float32, low: Float32, high: Float32, entries: Int, tuning: HeadTuning) -> Int:
    """(m,) person to whom each cell of one cluster belongs, NONE where it is nobody's.

    The cluster is divided if it holds (a) two or more heads or posts, (b) one beside something higher than a person,
    or (c) one with a load on one side. Else all cells are NONE, and the cluster is one object. A load lies to one
    side of the person, is as high as a trolley, and ends below the shoulders. A rider has a wheel on each side, which
    is lower. A post has no shoulders. It is separated like a person, but without what lies around it.

    Args:
        x: (m,) a point of each cell [m, sensor frame].
        y: (m,) the same.
        low: (m,) least height of its points above the ground [m].
        high: (m,) their greatest height [m].
        entries: (m,) number of its points.
        tuning: heads, the people below, and what is pushed.
    """
    at = np.stack((x, y)).astype(np.float64)
    person = np.full(len(x), NONE)
    peaks = _peaks(at, high, tuning)
    if not peaks:
        return person
    square_m2 = np.stack([_square_m2(at, peak) for peak in peaks])  # (peaks, m)
    near = square_m2 < tuning.reach_m * tuning.reach_m
    nearest = square_m2.argmin(axis=0)
    nearest_m2 = square_m2.min(axis=0)
    lower = _is_lower(at, high, nearest_m2, tuning)
    reach_m2 = np.zeros(len(peaks))  # cells of a peak that is nothing stay
    for k, peak in enumerate(peaks):
        own = (nearest == k) & lower
        if lower[peak]:
            reach_m2[k] = _reach_m2(at, low, high, entries, own, near[k], peak, tuning)
    heads = reach_m2.nonzero()[0]
    # Peaks come from the highest on, so something higher than a person is the first of them.
    beside_higher = not lower[peaks[0]]
    one_divides = len(heads) == 1 and (beside_higher or _pushes(at, high, entries, peaks[heads[0]], tuning))
    if len(heads) > 1 or one_divides:
        person_of_peak = np.full(len(peaks), NONE)
        person_of_peak[heads] = np.arange(len(heads))
        around = (nearest_m2 < reach_m2[nearest]) & lower
        person[around] = person_of_peak[nearest[around]]
    return person


def _reach_m2(
    at: Float64, low: Float32, high: Float32, entries: Int, own: Bool, near: Bool, peak: int, tuning: HeadTuning
) -> float:
    """Square of the distance within which cells belong to a peak [m2]; 0 where it is neither a person nor a post.

    The peak is given with its own cells (m,) and the cells near it (m,).
    """
    body = own & near
    top = own & (high > high[peak] - tuning.head_height_m)
    stands = low[body].min() < tuning.max_bottom_m and entries[body].sum() >= tuning.min_points
    if not (stands and _extent_m(at[:, top]) < tuning.max_head_m):
        return 0.0
    shoulders = body & (high > high[peak] - np.float32(tuning.shoulders_m))
    is_post = _extent_m(at[:, shoulders]) < tuning.min_shoulders_m
    reach_m = tuning.post_reach_m if is_post else tuning.reach_m
    return reach_m * reach_m


def _is_lower(at: Float64, high: Float32, peak_m2: Float64, tuning: HeadTuning) -> Bool:
    """(m,) cells of what is no higher than a person; none that is nearer to a higher cell than to its peak.

    Args:
        at: (2, m) positions of the cells [m].
        high: (m,) greatest heights of the points of the cells [m].
        peak_m2: (m,) square of the distance of each cell to the nearest peak [m2].
        tuning: height of a person.
    """
    lower: Bool = high < np.float32(tuning.max_top_m)
    for cell in np.flatnonzero(~lower):
        lower &= peak_m2 < _square_m2(at, int(cell))
    return lower


def _square_m2(at: Float64, cell: int) -> Float64:
    """(m,) square of the distance of each cell to one of them [m2]."""
    x, y = at - at[:, cell, None]
    square_m2: Float64 = x * x + y * y
    return square_m2


def _extent_m(at: Float64) -> float:
    """Diagonal of the rectangle around points [m]."""
    width_m, depth_m = at.max(axis=1) - at.min(axis=1)
    return float(np.sqrt(width_m * width_m + depth_m * depth_m))


def _peaks(at: Float64, high: Float32, tuning: HeadTuning) -> list[int]:
    """Cells that are the highest around, and between which the heights dip, from the highest on."""
    peaks: list[int] = []
    remaining: Bool = high >= tuning.min_top_m
    while remaining.any():
        peak = int(np.where(remaining, high, -np.inf).argmax())
        if all(_are_two_heads(at, high, peak, other, tuning) for other in peaks):
            peaks.append(peak)
        remaining &= _square_m2(at, peak) >= tuning.reach_m * tuning.reach_m
    return peaks


def _are_two_heads(at: Float64, high: Float32, peak: int, other: int, tuning: HeadTuning) -> bool:
    """Whether two peaks may be two heads: they are far apart, or the heights between them dip.

    A part of the corridor without cells tells nothing. Without any cell in it, near peaks are one head.
    """
    x, y = at - at[:, other, None]
    dx = x[peak]
    dy = y[peak]
    square_m2 = dx * dx + dy * dy
    if square_m2 > tuning.max_apart_m * tuning.max_apart_m:
        return True
    share = (x * dx + y * dy) / square_m2
    aside_m2 = y * dx - x * dy  # distance from the line through the peaks, times that of the peaks
    first, last = CORRIDOR_SHARES
    between = (share >= first) & (share < last)
    between &= aside_m2 * aside_m2 < CORRIDOR_HALF_WIDTH_M * CORRIDOR_HALF_WIDTH_M * square_m2
    part = np.minimum((share[between] - first) * (BINS / (last - first)), BINS - 1).astype(np.int64)
    top = np.full(BINS, -np.inf, np.float32)
    np.maximum.at(top, part, high[between])
    lowest = top[top > -np.inf].min(initial=np.inf)
    return bool(lowest <= min(high[peak], high[other]) - np.float32(tuning.min_dip_m))


def _pushes(at: Float64, high: Float32, entries: Int, peak: int, tuning: HeadTuning) -> bool:
    """Whether a load lies to one side of the person below a peak."""
    square_m2 = _square_m2(at, peak)
    load: Bool = square_m2 > tuning.load_m * tuning.load_m
    if entries[load].sum() < tuning.min_points:
        return False
    top_m = high[load].max()
    if top_m < tuning.min_load_top_m or top_m > high[peak] - np.float32(tuning.head_height_m):
        return False
    x, y = at - at[:, peak, None]
    farthest = square_m2.argmax()
    # No cell lies more than reach_m behind the person, seen from the farthest cell.
    along = x * x[farthest] + y * y[farthest]
    return bool(along.min() >= -tuning.reach_m * np.sqrt(square_m2[farthest]))
