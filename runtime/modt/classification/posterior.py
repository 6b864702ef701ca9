"""Probabilities of classes: what keeps them distributions, and what moves them with the boxes.

Before its first view a track is what its box makes it; afterwards what the views said, moved by what its box says now
and did not say then. What grows to the size of a car as it comes near is more of one; a piece of a car is less. A
class that is settled stays, but how sure it is goes with the box. Now and then what a track shows is a piece of its
object, or something that it slid to: of that the box alone tells.
"""

from __future__ import annotations

import numpy as np

from modt.classification.prior import Prior
from modt.types import NONE, Float64, Proposals, Tracks

FLOOR = 1e-4
"""Least likelihood that a view gives a class, and least posterior: no class is ever ruled out for good."""


def expect(tracks: Tracks, proposals: Proposals, prior: Prior, weight: float, slip: float) -> None:
    """Takes in what the boxes of this frame say: all that is known before a view, and what is new since the last.

    Args:
        tracks: whose posteriors are written.
        proposals: of the frame.
        prior: what it thinks of each.
        weight: of what the box says now and did not say at the last view.
        slip: probability that a proposal is not what its track is; of such a one its box alone tells.
    """
    rows = np.flatnonzero(tracks.proposal != NONE)
    tracks.prior[rows] = prior.of(proposals)[tracks.proposal[rows]]
    classified = tracks.viewed[rows]
    unknown = rows[~classified & ~tracks.final[rows]]
    tracks.posterior[unknown] = tracks.prior[unknown]
    known = rows[classified]
    now, then = (np.maximum(said.take(known, axis=0), FLOOR) for said in (tracks.prior, tracks.key_prior))
    same = normal(np.log(tracks.key_posterior.take(known, axis=0)) + weight * np.log(now / then))
    tracks.posterior[known] = (1.0 - slip) * same + slip * tracks.prior.take(known, axis=0)


def sane(probability: Float64) -> Float64:
    """Rows that are distributions, no entry below the floor; a row that is none (NaN, all zero) says nothing."""
    finite = np.where(np.isfinite(probability), np.maximum(probability, 0.0), 0.0)
    greatest = finite.max(axis=1, keepdims=True, initial=0.0)
    relative = np.divide(finite, greatest, out=np.ones_like(finite), where=greatest > 0)
    floored = np.maximum(relative / relative.sum(axis=1, keepdims=True), FLOOR)
    kept: Float64 = floored / floored.sum(axis=1, keepdims=True)
    return kept


def normal(log_weight: Float64) -> Float64:
    """Rows of log weights as distributions."""
    return sane(np.exp(log_weight - log_weight.max(axis=1, keepdims=True, initial=-np.inf)))
