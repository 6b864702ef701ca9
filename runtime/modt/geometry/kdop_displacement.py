"""How far an outline moved, and how surely: what its ends say of each other.

An end that comes into view, or is hidden, moves; the other stays. Along each of the four axes both ends have a say
where they moved alike; else the one that moved less is taken for the object's own. How far the two disagree is how
wrong that may be. It stays wrong: the outline is compared with what was taken for the object's before, so an axis
that was doubtful is doubted for a while.
"""

from __future__ import annotations

import numpy as np

from modt.geometry.kdop import AXES, widths
from modt.types import Float64

AGREE_M = 0.6
"""Ends of an outline that differ by less moved with the object, if it is up to a metre long and so is seen whole; of
a longer one that comes into view by as much less as it is longer."""
DOUBT = 0.3
"""Deviation of a shift by ends that disagree, relative to how far they do, or to what is seen if that is less."""
SOFT_M = 0.3
"""Added to lengths that are compared: a difference of a few returns is noise."""
KEPT = 0.97
"""What is left of a doubt a frame later."""
PRODUCTS = np.stack([AXES[0] * AXES[0], AXES[1] * AXES[1], AXES[0] * AXES[1]])
"""(3, 4) xx, yy and xy of the axes."""


def moves(a: Float64, b: Float64) -> tuple[Float64, Float64]:
    """(4, K) and (4, K) along each axis, how far the end ahead and the end behind moved from outlines a to b [m]."""
    gain = b - a
    return gain[:4], -gain[4:]


def least(a: Float64, b: Float64) -> Float64:
    """(4, K) along each axis, how far the end moved that moved less from outlines a to b (8, K) [m]."""
    ahead, behind = moves(a, b)
    return np.where(np.abs(ahead) < np.abs(behind), ahead, behind)


def shift_between(a: Float64, b: Float64) -> Float64:
    """(K, 2) from outlines a to b [m], every axis as good as the other."""
    moved, _, _ = _moved(a, b, widths(b))
    shift: Float64 = (AXES @ moved).T / 2  # four axes a quarter turn apart in pairs: A A' = 2 I
    return shift


def measured(a: Float64, b: Float64, variance: Float64, before: Float64) -> tuple[Float64, Float64, Float64]:
    """The shift between outlines, and how sure it is.

    Args:
        a: (8, K) outlines before [m].
        b: (8, K) and after [m].
        variance: (K,) of the shift, were there no doubt [m2].
        before: (4, K) doubt of each a frame ago.

    Returns:
        shift: (K, 2) from a to b [m].
        covariance: (K, 2, 2) of it [m2].
        doubt: (4, K) variance along each axis by what its ends disagree, or did, no more than what is seen [m2].
    """
    seen = widths(b)
    moved, unlike, apart = _moved(a, b, seen)
    end_variance = np.maximum(DOUBT**2 * unlike * np.square(apart), KEPT * before)
    np.minimum(end_variance, np.square(DOUBT * seen.max(axis=0)), out=end_variance)
    weight = 0.5 / (
        variance + end_variance
    )  # were they alike, the four would say as much as one of them in each direction
    (xx, yy, xy), (x, y) = PRODUCTS @ weight, AXES @ (weight * moved)
    scale = 1.0 / (xx * yy - xy * xy)
    xx, yy, xy = scale * yy, scale * xx, -scale * xy  # the inverse
    shift, covariance = np.empty((len(x), 2)), np.empty((len(x), 2, 2))
    shift[:, 0], shift[:, 1] = xx * x + xy * y, xy * x + yy * y
    covariance[:, 0, 0], covariance[:, 1, 1] = xx, yy
    covariance[:, 0, 1] = covariance[:, 1, 0] = xy
    return shift, covariance, end_variance


def _moved(a: Float64, b: Float64, seen: Float64) -> tuple[Float64, Float64, Float64]:
    """Along each axis how far outlines moved from a to b, which are seen so long (4, K) [m].

    Returns:
        moved: (4, K) by both ends where they agree, else by that which moved less [m].
        unlike: (4, K) from 0, where both ends moved as one, to 1.
        apart: (4, K) how far they did not [m].
    """
    gain = b - a
    both, apart = gain[:4] - gain[4:], gain[:4] + gain[4:]
    longest = np.maximum(seen, seen - apart).max(axis=0)
    unlike = 1 - np.square(np.maximum(1 - np.square(apart * (np.maximum(longest, 1.0) / AGREE_M)), 0.0))
    moved = (both - unlike * np.copysign(apart, both)) / 2  # the lesser: half the sum less half what parts them
    return moved, unlike, apart


def compare(a: Float64, b: Float64) -> tuple[Float64, Float64, Float64, Float64]:
    """How outlines b (8, K) lie to outlines a (8, K), one by one.

    Returns:
        shift: (K, 2) from a to b [m], by both ends along each axis where they agree, else by that which moved less.
        size: (K,) mean difference of the logarithms of their lengths.
        overlap: (K,) intersection over union.
        cover: (K,) intersection over the smaller of the two.
    """
    return shift_between(a, b), *shape_similarity(a, b)


def shape_similarity(a: Float64, b: Float64) -> tuple[Float64, Float64, Float64]:
    """(K,) compare's size, overlap and cover."""
    length_a, length_b = widths(a), widths(b)
    size = np.abs(np.log((length_b + SOFT_M) / (length_a + SOFT_M))).sum(axis=0) / 4
    pad = SOFT_M / 3
    common = np.maximum(widths(np.minimum(a, b)) + pad, 0.0)
    squares = [side[:2] * side[2:] for side in (length_a + pad, length_b + pad)]
    shared = common[:2] * common[2:]  # in the upright square, and in the one on its corner
    overlap = np.minimum(*(shared / (squares[0] + squares[1] - shared)))
    cover = np.minimum(*(shared / np.minimum(*squares)))
    return size, overlap, cover
