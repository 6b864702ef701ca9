"""Log-linear pool of network, box and reflectance.

The box tells objects from background, not one class of objects from another.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np

from modt.types import Float64

_MIN_PROBABILITY = 1e-12
"""Floor that keeps logarithms finite."""


@dataclass(frozen=True)
class PoolWeights:
    """Exponents of the likelihoods that multiply the class frequency to a posterior.

    Attributes:
        network: weight of P(points | class).
        box: weight of P(box | object) / P(box | background).
        reflectance: weight of P(reflectance | class, box).
    """

    network: float = 1.0
    box: float = 0.0
    reflectance: float = 0.0

    @classmethod
    def from_dict(cls, content: Mapping[str, Any]) -> PoolWeights:
        """Read from a model's metadata.

        Raises:
            KeyError, TypeError, ValueError: missing, not a number, or out of range.
        """
        weights = [float(content[name]) for name in ("network", "box", "reflectance")]
        if not all(0.0 <= weight <= 1.0 for weight in weights):
            raise ValueError(f"weights {weights}, wanted 0 to 1 each")
        return cls(*weights)


def _log_odds(log_probability: Float64) -> Float64:
    """(R,) logarithm of the odds of any object against background, of log probabilities (R, C)."""
    log_odds: Float64 = np.log(np.exp(log_probability[:, 1:] - log_probability[:, :1]).sum(axis=1))
    return log_odds


def pooled_prior(log_box: Float64, log_frequency: Float64, weight: float) -> Float64:
    """(R, C) logarithm of the class frequency times the likelihood of an object by its box, up to a constant.

    Args:
        log_box: (R, C) log P(class | box), up to a constant a row.
        log_frequency: (C,) log of the frequencies of the classes.
        weight: exponent of the box.
    """
    log_ratio = np.zeros(log_box.shape)
    if weight:  # P(box | object) / P(box | background)
        log_ratio[:, 1:] = weight * (_log_odds(log_box) - _assumed_log_odds(log_frequency.tobytes()))[:, None]
    return log_frequency + log_ratio


@cache
def _assumed_log_odds(log_frequency: bytes) -> Float64:
    """(1,) log odds of any object by the class frequency, whose bytes are the key: it is the same in every frame."""
    return _log_odds(np.frombuffer(log_frequency)[None])


def log_pool(
    network: Float64, log_box: Float64, log_reflectance: Float64, log_frequency: Float64, weights: PoolWeights
) -> Float64:
    """(R, C) logarithm of the pool, up to a constant.

    Args:
        network: (R, C) P(class | points) of the network.
        log_box: (R, C) log P(class | box), up to a constant a row.
        log_reflectance: (R, C) log P(reflectance | class, box), up to a constant a row.
        log_frequency: (C,) log of the frequencies of the classes that network and box assume.
        weights: exponents of the three.
    """
    score = pooled_prior(log_box, log_frequency, weights.box)
    score += weights.network * (np.log(np.maximum(network, _MIN_PROBABILITY)) - log_frequency)
    if weights.reflectance:
        score += weights.reflectance * log_reflectance
    return score


def softmax(log_probability: Float64) -> Float64:
    """(R, C) probabilities whose logarithms are given up to a constant a row."""
    by_class = log_probability.T.copy()  # arithmetic along axes of so few would be slow
    relative = np.exp(by_class - by_class.max(axis=0))
    probability: Float64 = (relative / relative.sum(axis=0)).T
    return probability
