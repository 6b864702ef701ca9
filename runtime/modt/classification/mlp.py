"""A small network, hyperbolic tangents between its layers, as the metadata of a model holds it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import Any

import numpy as np

from modt.classes import N_CLASSES
from modt.types import Float64

Layers = Sequence[tuple[Float64, Float64]]
"""(in, out) weight and (out,) bias of each."""


def logits(layers: Layers, feature: Float64) -> Float64:
    """(R, 4) of features (R, F)."""
    *hidden, (weight, bias) = layers
    value = feature
    for hidden_weight, hidden_bias in hidden:
        value = np.tanh(value @ hidden_weight + hidden_bias)
    score: Float64 = value @ weight + bias
    return score


def as_lists(layers: Layers) -> list[list[Any]]:
    """The layers as JSON has them."""
    return [[weight.tolist(), bias.tolist()] for weight, bias in layers]


def of_lists(lists: Any, n_features: int) -> Layers:
    """Layers from JSON.

    Raises:
        TypeError, ValueError: they are none, or not of so many features and the classes.
    """
    layers = [(np.array(weight, np.float64), np.array(bias, np.float64)) for weight, bias in lists]
    if not all(np.isfinite(weight).all() and np.isfinite(bias).all() for weight, bias in layers):
        raise ValueError("weights that are not finite")
    widths = [n_features, *(len(bias) for _, bias in layers)]
    if widths[-1] != N_CLASSES or [weight.shape for weight, _ in layers] != [*pairwise(widths)]:
        raise ValueError(f"layers of {' x '.join(map(str, widths))}, wanted {n_features} to {N_CLASSES}")
    return layers


def part_of(held: Mapping[str, Any], name: str) -> float:
    """A number from 0 to 1 that stands beside layers.

    Raises:
        KeyError, TypeError, ValueError: there is none of the name, or it is none.
    """
    part = float(held[name])
    if not 0.0 <= part <= 1.0:
        raise ValueError(f"a {name} of {part}, wanted 0 to 1")
    return part
