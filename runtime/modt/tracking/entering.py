"""Displacement of what comes into view from behind something nearer.

The part of a vehicle that is seen grows as it comes into view: its front moves, and the end at the edge of what hides
the rest stays. What shows a new part of itself while it rests has such an end too, but no free one that leads.
"""

from __future__ import annotations

import math

import numpy as np

from modt.geometry.kdop import AXES, DIRECTIONS, shift_along_axes
from modt.geometry.tuning import ShapeTuning
from modt.types import Bool, Float64

SIDEWAYS = math.sin(math.pi / 8)
"""Sine of the angle to the line of sight from which a direction of k-DOPs belongs to a side: half their spacing."""


def free_ends(bounded: Bool, sight: Float64) -> Bool:
    """(8, R) ends of k-DOPs that the object makes, not the view.

    Args:
        bounded: (R, 2) sides that are bounded, clockwise and counter-clockwise.
        sight: (R, 2) vectors from the sensor to the objects [m].
    """
    ahead = sight / np.maximum(np.hypot(sight[:, 0], sight[:, 1]), 1e-6)[:, None]
    left = np.column_stack([-ahead[:, 1], ahead[:, 0]])
    along_left = left @ DIRECTIONS
    near = ahead @ DIRECTIONS < 0  # what ends an object far from the sensor is hidden by itself
    sides = [along_left > SIDEWAYS, along_left < -SIDEWAYS]
    free: Bool = np.select(sides, [~bounded[:, 1:], ~bounded[:, :1]], near).T
    return free


def further_shift(before: Float64, after: Float64, free: Bool, tuning: ShapeTuning) -> tuple[Float64, Bool]:
    """Displacement along each axis beyond that of the end that moved less, of k-DOPs before and after (8, R).

    It is that of the end that moved more, where this end is free, the other one is not, and the k-DOP grew.

    Returns:
        shift: (4, R) [m], 0 elsewhere.
        comes: (R,) whether there is any.
    """
    _, disagreement, growth = shift_along_axes(before, after, tuning)
    outward = after - before
    both = outward[:4] - outward[4:]
    ahead = free[:4] & ~free[4:] & (both > 0)
    behind = free[4:] & ~free[:4] & (both < 0)
    comes = (ahead | behind) & (growth > 0)
    shift: Float64 = np.where(comes, disagreement * np.copysign(growth, both), 0.0)
    return shift, np.logical_or.reduce(comes, axis=0)


def corrected(covariance: Float64, weight: Float64, shift: Float64) -> Float64:
    """Displacement (R, 2) of positions of a covariance (R, 2, 2), given a shift (4, R) along axes of weights (4, R).

    The weights are those by which the axes measured the positions.
    """
    information = AXES @ (weight * shift)
    displacement: Float64 = np.einsum("nij,jn->ni", covariance, information)
    return displacement
