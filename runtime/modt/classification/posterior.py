"""Class posteriors: normalisation with a floor, and the update of a track by the box of the frame.

Before its first view a track has the prior of its box; an inherited class has probability 1. Afterwards it has the
posterior of its last key view, updated by the change of that prior since the view. A final class stays, but its
posterior follows the box.
"""

from __future__ import annotations

import numpy as np

from modt.classes import N_CLASSES, ObjectClass
from modt.classification.prior import Prior
from modt.config import FusionConfig
from modt.types import NONE, Float64, Proposals, Tracks

MIN_PROBABILITY = 1e-4
"""Floor of every likelihood and posterior: no class is excluded for good."""
_BACKGROUND = np.eye(N_CLASSES)[ObjectClass.BACKGROUND]


def update_from_boxes(tracks: Tracks, proposals: Proposals, prior: Prior, config: FusionConfig) -> None:
    """Write prior and posterior of every track with a proposal, P ~ P_view (P_box now / P_box then) ^ weight.

    With `mismatch_probability` the proposal is not the object of its track: the posterior is then the prior.
    """
    rows = (tracks.proposal != NONE).nonzero()[0]
    tracks.prior[rows] = prior.probability(proposals)[tracks.proposal[rows]]
    viewed = tracks.viewed[rows]
    new, known = rows[~viewed], rows[viewed]
    tracks.posterior[new] = np.where(tracks.inherited[new, None], _BACKGROUND, tracks.prior.take(new, axis=0))
    now, then = (np.maximum(p.take(known, axis=0), MIN_PROBABILITY) for p in (tracks.prior, tracks.key_prior))
    change = config.box_update_weight * np.log(now / then)
    matched = from_log_weights(np.log(tracks.key_posterior.take(known, axis=0)) + change)
    mismatch = config.mismatch_probability
    tracks.posterior[known] = (1.0 - mismatch) * matched + mismatch * tracks.prior.take(known, axis=0)


def normalise(probability: Float64) -> Float64:
    """(R, 4) rows scaled to sum 1 with entries of at least MIN_PROBABILITY; uniform where no entry is above 0."""
    finite = np.where(np.isfinite(probability), np.maximum(probability, 0.0), 0.0)
    greatest = finite.max(axis=1, keepdims=True, initial=0.0)
    relative = np.divide(finite, greatest, out=np.ones_like(finite), where=greatest > 0)
    floored = np.maximum(relative / relative.sum(axis=1, keepdims=True), MIN_PROBABILITY)
    normalised: Float64 = floored / floored.sum(axis=1, keepdims=True)
    return normalised


def from_log_weights(log_weight: Float64) -> Float64:
    """(R, 4) softmax of each row, with the floor of `normalise`."""
    return normalise(np.exp(log_weight - log_weight.max(axis=1, keepdims=True, initial=-np.inf)))
