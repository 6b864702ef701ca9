"""Vectors (R, 2) in the ground plane. Headings are unit vectors, so no angle is wrapped."""

from __future__ import annotations

import numpy as np

from modt.types import Float64


def dot(a: Float64, b: Float64) -> Float64:
    """(R,) products of vectors (R, 2)."""
    product: Float64 = a[:, 0] * b[:, 0] + a[:, 1] * b[:, 1]
    return product


def left_of(heading: Float64) -> Float64:
    """(R, 2) headings a quarter turn to the left."""
    return np.stack([-heading[:, 1], heading[:, 0]], axis=1)


def along_and_left(heading: Float64, vector: Float64) -> Float64:
    """(R, 2) components of vectors (R, 2) along headings (R, 2), and to the left of them."""
    return np.stack([dot(heading, vector), dot(left_of(heading), vector)], axis=1)


def turned(
    heading: Float64, variance: Float64, measured: Float64, measured_variance: Float64
) -> tuple[Float64, Float64]:
    """Headings (R, 2) and their variances (R,) after measured headings with theirs."""
    gain = variance / (variance + measured_variance)
    turned = heading + gain[:, None] * (measured - heading)
    return turned / np.sqrt(dot(turned, turned))[:, None], (1 - gain) * variance
