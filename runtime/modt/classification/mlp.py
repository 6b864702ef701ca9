"""Multilayer perceptron with tanh activations, stored as JSON in the metadata of a model."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from modt.classes import N_CLASSES
from modt.types import Float64

Weights = NDArray[np.floating[Any]]
Layers = Sequence[tuple[Weights, Weights]]
"""(in, out) weight and (out,) bias of each layer."""


def logits(layers: Layers, features: Float64) -> Float64:
    """(R, 4) of (R, F) features, worked out in the precision of the layers."""
    *hidden, (weight, bias) = layers
    value: Weights = features.astype(weight.dtype)
    for hidden_weight, hidden_bias in hidden:
        value = np.tanh(value @ hidden_weight + hidden_bias)
    output: Float64 = (value @ weight + bias).astype(np.float64)
    return output


def to_lists(layers: Layers) -> list[list[Any]]:
    """Layers for JSON."""
    return [[weight.tolist(), bias.tolist()] for weight, bias in layers]


def from_lists(lists: Any, n_features: int) -> Layers:
    """Layers from JSON, in single precision: half the time of double.

    Raises:
        TypeError, ValueError: not layers, not finite, or not from n_features inputs to the classes.
    """
    with np.errstate(over="ignore"):
        layers = [(np.array(weight, np.float32), np.array(bias, np.float32)) for weight, bias in lists]
    if not all(np.isfinite(weight).all() and np.isfinite(bias).all() for weight, bias in layers):
        raise ValueError("weights that are not finite")
    widths = [n_features, *(len(bias) for _, bias in layers)]
    if widths[-1] != N_CLASSES or [weight.shape for weight, _ in layers] != [*pairwise(widths)]:
        raise ValueError(f"layers of {' x '.join(map(str, widths))}, wanted {n_features} to {N_CLASSES}")
    return layers


def fraction(content: Mapping[str, Any], key: str) -> float:
    """Number from 0 to 1 under a key.

    Raises:
        KeyError, TypeError, ValueError: missing, not a number, or out of range.
    """
    value = float(content[key])
    if not 0.0 <= value <= 1.0:
        raise ValueError(f"{key} of {value}, wanted 0 to 1")
    return value
