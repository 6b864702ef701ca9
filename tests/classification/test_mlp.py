"""The perceptron and its JSON form."""

from __future__ import annotations

import json
from itertools import chain
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from modt.classification.box_classifier import from_lists, logits, to_lists
from modt.types import Float64

RNG = np.random.default_rng(5)
FEATURES = 7
LAYERS = [(RNG.normal(size=(FEATURES, 5)), RNG.normal(size=5)), (RNG.normal(size=(5, 4)), RNG.normal(size=4))]


@given(arrays(np.float64, (6, FEATURES), elements=st.floats(-5, 5)))
def test_logits_agree_with_the_reference(feature: Float64) -> None:
    (w0, b0), (w1, b1) = LAYERS
    for row, found in zip(feature, logits(LAYERS, feature), strict=True):
        hidden = [np.tanh(sum(row[i] * w0[i, j] for i in range(FEATURES)) + b0[j]) for j in range(5)]
        expected = [sum(hidden[j] * w1[j, k] for j in range(5)) + b1[k] for k in range(4)]
        np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-9)


@given(arrays(np.float64, (6, FEATURES), elements=st.floats(-5, 5)))
def test_single_precision_is_close_to_double(feature: Float64) -> None:
    single = [(weight.astype(np.float32), bias.astype(np.float32)) for weight, bias in LAYERS]
    np.testing.assert_allclose(logits(single, feature), logits(LAYERS, feature), rtol=0, atol=2e-5)


def test_layers_round_trip_through_json_in_single_precision() -> None:
    loaded = from_lists(json.loads(json.dumps(to_lists(LAYERS))), FEATURES)
    for own, found in zip(chain(*LAYERS), chain(*loaded), strict=True):
        np.testing.assert_array_equal(own.astype(np.float32), found, strict=True)
    assert to_lists(loaded) == to_lists(from_lists(to_lists(loaded), FEATURES))


@pytest.mark.parametrize(
    "lists",
    [
        [],
        [[[[1]], [1]]],
        [[[[float("nan"), 0, 0, 0]], [0, 0, 0, 0]]],
        [[[[1e300] * 4] * 7, [0.0] * 4]],
        [[[[0.0] * 4] * 6, [0.0] * 4]],
        [[[[0.0] * 3] * 7, [0.0] * 3]],
        {},
        3,
    ],
)
def test_malformed_layers_are_rejected(lists: Any) -> None:
    with pytest.raises((TypeError, ValueError)):
        from_lists(lists, FEATURES)
