"""Weights of the pool of network, box and reflectance (modt.classification.pool), fitted on held-out posteriors."""

from __future__ import annotations

import numpy as np
from scipy.optimize import minimize
from scipy.special import log_softmax

from modt.classification.pool import PoolWeights, log_pool
from modt.types import Float64
from tools.train.held_out import Validation


def fit_pool(
    network: Float64, box: Float64, reflectance: Float64, valid: Validation, weight: Float64
) -> tuple[PoolWeights, Float64]:
    """The weights, all in 0 to 1, that minimise the log loss, and the (R, 4) log posteriors of the pool.

    Args:
        network: (R, 4) P(class | points).
        box: (R, 4) P(class | box).
        reflectance: (R, 4) log P(reflectance | class, box), zeros without: its weight is then zero.
        valid: the crops.
        weight: (R,) of each, 1 in total.
    """
    log_frequency = np.log(valid.class_frequency.clip(1e-9))

    def log_posterior(weights: PoolWeights) -> Float64:
        out: Float64 = log_softmax(log_pool(network, np.log(box), reflectance, log_frequency, weights), axis=1)
        return out

    def loss(x: Float64) -> float:
        return -float(weight @ log_posterior(PoolWeights(*x.tolist()))[np.arange(len(valid.label)), valid.label])

    known = bool(reflectance.any())
    found = minimize(loss, x0=(0.8, 0.4, 0.5 * known), bounds=((0.0, 1.0), (0.0, 1.0), (0.0, float(known))))
    weights = PoolWeights(*(round(w, 2) for w in found.x.tolist()))
    return weights, log_posterior(weights)
