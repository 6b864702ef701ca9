"""Displacement between k-DOPs, and how certain it is.

An end of a k-DOP that comes into view, or is hidden, moves; the other stays. Along each of the four axes the object
moved by the mean of both ends where they agree, else by the displacement of the end that moved less. The disagreement
of the two ends is a variance of the position along that axis, which lasts: the next k-DOP is compared with one that
was already in doubt.
"""

from __future__ import annotations

import numpy as np

from modt.geometry.kdop import AXES, widths
from modt.geometry.kdop_pairs import SOFT_M, shares
from modt.types import Float64

AGREE_M = 0.6
"""Ends whose displacements differ by less agree, of a k-DOP up to a metre long; the limit falls with the length."""
_DISAGREEMENT = 0.3
"""Standard deviation of a displacement by ends that disagree, relative to the disagreement or the width, if less."""
_DECAY = 0.97
"""Share of that variance that is left a frame later."""
_PRODUCTS = np.stack([AXES[0] * AXES[0], AXES[1] * AXES[1], AXES[0] * AXES[1]])
"""(3, 4) xx, yy and xy of the axes."""


def shift_between(a: Float64, b: Float64) -> Float64:
    """(K, 2) displacement from k-DOPs a to b [m], all axes weighted alike."""
    moved, _, _ = _moved(a, b)
    shift: Float64 = (AXES @ moved).T / 2  # four axes a quarter turn apart in pairs: A A' = 2 I
    return shift


def measured(a: Float64, b: Float64, variance: float, before: Float64) -> tuple[Float64, Float64, Float64]:
    """Displacement between k-DOPs with its covariance.

    Args:
        a: (8, K) k-DOPs before [m].
        b: (8, K) and after [m].
        variance: of the displacement if the ends agree [m2].
        before: (4, K) variance along each axis by ends that disagreed, a frame ago [m2].

    Returns:
        shift: (K, 2) from a to b [m].
        covariance: (K, 2, 2) of it [m2].
        end_variance: (4, K) variance along each axis by ends that disagree, or did [m2].
    """
    width = widths(b)
    moved, unlike, apart = _moved(a, b)
    end_variance = np.maximum(_DISAGREEMENT**2 * unlike * np.square(apart), _DECAY * before)
    np.minimum(end_variance, np.square(_DISAGREEMENT * width.max(axis=0)), out=end_variance)
    # The four axes together weigh as much as one measurement in each direction.
    weight = 0.5 / (variance + end_variance)
    (xx, yy, xy), (x, y) = _PRODUCTS @ weight, AXES @ (weight * moved)
    scale = 1.0 / (xx * yy - xy * xy)
    xx, yy, xy = scale * yy, scale * xx, -scale * xy  # the inverse
    shift, covariance = np.empty((len(x), 2)), np.empty((len(x), 2, 2))
    shift[:, 0], shift[:, 1] = xx * x + xy * y, xy * x + yy * y
    covariance[:, 0, 0], covariance[:, 1, 1] = xx, yy
    covariance[:, 0, 1] = covariance[:, 1, 0] = xy
    return shift, covariance, end_variance


def _moved(a: Float64, b: Float64) -> tuple[Float64, Float64, Float64]:
    """Displacement along each axis from k-DOPs a to b (8, K).

    Returns:
        moved: (4, K) mean of both ends where they agree, else that of the end that moved less [m].
        unlike: (4, K) from 0, where both ends moved alike, to 1.
        apart: (4, K) difference of their displacements outward [m].
    """
    width, gain = widths(b), b - a
    both, apart = gain[:4] - gain[4:], gain[:4] + gain[4:]
    longest = np.maximum(width, width - apart).max(axis=0)
    unlike = 1 - np.square(np.maximum(1 - np.square(apart * (np.maximum(longest, 1.0) / AGREE_M)), 0.0))
    return (both - unlike * np.copysign(apart, both)) / 2, unlike, apart


def shape_similarity(a: Float64, b: Float64) -> tuple[Float64, Float64]:
    """(K,) mean difference of the logarithms of the widths of k-DOPs a and b (8, K), one by one, and (K,) overlap."""
    size = np.abs(np.log((widths(b) + SOFT_M) / (widths(a) + SOFT_M))).sum(axis=0) / 4
    return size, shares(a, b)[0]
