"""Probabilities of classes: what keeps them distributions, and what moves them with the boxes.

Before its first view a track is what its box makes it; afterwards what the views said, moved by what its box says now
and did not say then. What grows to the size of a car as it comes near is more of one; a piece of a car is less. A
class that is settled stays, but how sure it is goes with the box. What a track shows may be a piece of its object or
something that it slid to: the less it is like what was viewed, the less the views say of it, and the more its box.
"""

from __future__ import annotations

import numpy as np

from modt.classification.prior import Prior
from modt.types import NONE, Float64, Int, Proposals, Tracks

FLOOR = 1e-4
"""Least likelihood that a view gives a class, and least posterior: no class is ever ruled out for good."""


def expect(tracks: Tracks, proposals: Proposals, prior: Prior, weight: float) -> None:
    """Takes in what the boxes of this frame say: all that is known before a view, and what is new since the last.

    Args:
        tracks: whose posteriors are written.
        proposals: of the frame.
        prior: what it thinks of each.
        weight: of what the box says now and did not say at the last view.
    """
    rows = np.flatnonzero(tracks.proposal != NONE)
    tracks.prior[rows] = prior.of(proposals)[tracks.proposal[rows]]
    classified = tracks.classified[rows]
    unknown = rows[~classified & ~tracks.fixed[rows]]
    tracks.posterior[unknown] = tracks.prior[unknown]
    known = rows[classified]
    now, then = (np.log(np.maximum(said.take(known, axis=0), FLOOR)) for said in (tracks.prior, tracks.key_prior))
    viewed = np.log(tracks.key_posterior.take(known, axis=0)) + weight * (now - then)
    share = _alike(tracks, proposals, known)[:, None] if prior.tells else 1.0
    tracks.posterior[known] = normal(share * viewed + (1.0 - share) * now)


def _alike(tracks: Tracks, proposals: Proposals, rows: Int) -> Float64:
    """(R,) how like its last key observation a track looks, by the number of points: 1 as many, 0.5 four times."""
    count, key = proposals.count[tracks.proposal[rows]], tracks.key_points[rows]
    alike: Float64 = np.sqrt(np.minimum(count, key) / np.maximum(count, key))
    return alike


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
