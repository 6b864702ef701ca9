"""The box classifier: its features at run time and in training, its perceptron, and its place in a model."""

from __future__ import annotations

import json
from dataclasses import asdict, replace
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from numpy.testing import assert_allclose, assert_array_equal

from modt.classification.box_classifier import (
    METADATA_KEY,
    N_BOUND_FEATURES,
    N_FEATURES,
    BoxClassifier,
    bound_features,
    box_features,
    from_lists,
    from_metadata,
    logits,
    proposal_features,
)
from modt.classification.crops import gather, ground_z_m
from modt.classification.pool import PoolWeights
from modt.classification.prior import BoxScores
from modt.config import SegmentationConfig, SensorConfig
from modt.geometry import FieldOfView
from modt.segmentation.segmenter import Segmenter
from modt.types import Cut
from modt_simulation.synthetic_stream import SyntheticStream
from modt_training.dataset import Sensors, crop_features
from modt_training.export_pointnet import classifier_entry, to_lists
from tests.classification.scenes import blobs

RNG = np.random.default_rng(5)
SENSOR = SensorConfig()
LAYERS = [(RNG.normal(size=shape), RNG.normal(size=shape[1])) for shape in pairwise((N_FEATURES, 5, 4))]
WEIGHTS = PoolWeights(network=0.8, box=0.4)


@given(arrays(np.float64, (6, N_FEATURES), elements=st.floats(-5, 5)))
def test_logits_agree_with_the_reference_also_in_single_precision(feature):
    (w0, b0), (w1, b1) = LAYERS
    for row, found in zip(feature, logits(LAYERS, feature), strict=True):
        hidden = [np.tanh(sum(row[i] * w0[i, j] for i in range(N_FEATURES)) + b0[j]) for j in range(5)]
        expected = [sum(hidden[j] * w1[j, k] for j in range(5)) + b1[k] for k in range(4)]
        assert_allclose(found, expected, rtol=1e-9, atol=1e-9)
    single = from_lists(to_lists(LAYERS), N_FEATURES)
    assert_allclose(logits(single, feature), logits(LAYERS, feature), rtol=0, atol=2e-5)


def test_a_model_keeps_layers_in_single_precision_and_weights():
    loaded = from_metadata({METADATA_KEY: json.dumps(classifier_entry(LAYERS, WEIGHTS))})
    assert loaded.weights == WEIGHTS
    features = RNG.normal(size=(6, N_FEATURES))
    whole = np.zeros(6, np.int64)
    single = [(weight.astype(np.float32), bias.astype(np.float32)) for weight, bias in LAYERS]
    expected = BoxClassifier(single, WEIGHTS).log_probability(features, whole)
    assert_array_equal(loaded.log_probability(features, whole), expected)
    assert from_metadata({}) is None


def layer(value, inputs=N_FEATURES, outputs=4):
    return [[[[value] * outputs] * inputs, [0.0] * outputs]]


@pytest.mark.parametrize(
    "text",
    [
        *("[]", "{}", "no json"),
        *(
            json.dumps({"weights": asdict(WEIGHTS), "layers": layers})
            for layers in (layer(np.nan), layer(1e300), layer(0.0, N_FEATURES - 1), layer(0.0, outputs=3), 3)
        ),
        *(
            json.dumps({"weights": weights, "layers": to_lists(LAYERS)})
            for weights in (asdict(WEIGHTS) | {"network": 1.5}, {"network": 0.5, "box": 0.5}, None)
        ),
    ],
)
def test_malformed_metadata_is_rejected(text):
    with pytest.raises((KeyError, TypeError, ValueError)):
        from_metadata({METADATA_KEY: text})


def test_features_are_independent_of_the_resolution():
    box = np.array([[20.0, 0.0, -0.73, 4.0, 1.6, 1.4, 0.0]])
    ground = np.array([-1.73])
    fine = box_features(np.array([160]), box, ground, np.deg2rad(0.1) * np.deg2rad(0.2))
    coarse = box_features(np.array([40]), box, ground, np.deg2rad(0.2) * np.deg2rad(0.4))
    assert_allclose(fine, coarse)


def test_boxes_that_are_cut_where_a_person_may_go_on_are_scored_as_bounds():
    rng = np.random.default_rng(3)
    sizes, bounds = ([(rng.normal(size=(n, 4)), rng.normal(size=4))] for n in (N_FEATURES, N_BOUND_FEATURES))
    _, blob = blobs([10] * 6, rng)
    box = np.tile([2.0, 0.0, 0.0, 0.5, 0.5, 0.4, 0.0], (6, 1))
    box[3, 5] = 5.0  # higher than any person
    box[4, 2] = 0.6  # begins above the knees
    cut = np.array([0, Cut.TOP, Cut.TOP | Cut.NEAR, Cut.TOP, Cut.BOTTOM, Cut.BOTTOM])
    proposals = replace(blob, box=box, cut=cut, ground_z_m=np.full(6, -0.3))
    scored = BoxScores(BoxClassifier(sizes, 0.4, bounds), None, SENSOR).of(proposals).box
    features = proposal_features(proposals, SENSOR)
    by_size = logits(sizes, features)
    by_bounds = logits(bounds, bound_features(features, cut))
    is_bound = [False, True, True, False, True, False]
    assert_allclose(scored, np.where(np.array(is_bound)[:, None], by_bounds, by_size))
    without = BoxScores(BoxClassifier(sizes, 0.4), None, SENSOR).of(proposals).box
    assert_array_equal(without, by_size)


def test_scores_are_the_same_whatever_the_nearest_range_of_the_profile():
    features = np.random.default_rng(4).normal(size=(2, N_FEATURES))
    whole_in_range, cut_in_range = (np.array([Cut.TOP, Cut.BOTTOM | near]) for near in (0, Cut.NEAR))
    assert_array_equal(bound_features(features, whole_in_range), bound_features(features, cut_in_range))


def test_features_of_crops_and_proposals_agree():
    frame = next(iter(SyntheticStream("street", "hdl-64e", 0.1, seed=4)))
    proposals = Segmenter(SegmentationConfig(), SENSOR, FieldOfView()).segment(frame.points)
    crops = gather(proposals, np.arange(len(proposals)), 100_000)
    expected = proposal_features(proposals, SENSOR)
    assert len(crops) > 50
    sensors = Sensors.of(SENSOR, proposals.box, ground_z_m(proposals, slice(None), SENSOR))
    off = np.abs(crop_features(crops, sensors) - expected)
    assert off[:, 4:].max() < 1e-3  # height, foot and top
    assert np.quantile(off[:, :4], 0.9, axis=0).max() < 0.15  # at run time headings are fitted to fewer points
