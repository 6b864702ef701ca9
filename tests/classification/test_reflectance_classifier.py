"""The reflectance classifier, in the prior and in the pool with the network."""

from __future__ import annotations

import json
import logging
from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from scipy.special import softmax

from modt.classes import ObjectClass
from modt.classification import box_classifier
from modt.classification.box_classifier import (
    N_FEATURES,
    BoxClassifier,
    from_lists,
    logits,
    proposal_features,
)
from modt.classification.pointnet import CLASS_FREQUENCY_KEY
from modt.classification.pool import PoolWeights
from modt.classification.prior import BoxPrior, BoxScores, make_prior
from modt.classification.reflectance_classifier import (
    METADATA_KEY,
    from_metadata,
)
from modt.config import SensorConfig
from modt.errors import MisuseError
from modt.types import N_REFLECTANCE, Cut, Proposals
from modt_training.export_pointnet import classifier_entry, to_lists
from tests.classification.scenes import blobs, classifier

RNG = np.random.default_rng(6)
BOX_LAYERS = from_lists([[RNG.normal(size=(N_FEATURES, 4)), RNG.normal(size=4)]], N_FEATURES)
BOXES = BoxClassifier(BOX_LAYERS, PoolWeights())
N_BOTH = N_FEATURES + N_REFLECTANCE
LAYERS = from_lists([[RNG.normal(size=(N_BOTH, 4)), RNG.normal(size=4)]], N_BOTH)
REFLECTANCE = RNG.uniform(0, 1, (3, N_REFLECTANCE))
FREQUENCY = np.array([0.8, 0.12, 0.05, 0.03])
SENSOR = SensorConfig(reflectance="hdl-64e")
WITHOUT = BoxPrior(BoxScores(BOXES, None, SENSOR), FREQUENCY)
"""The prior without reflectance."""
WEIGHTS = PoolWeights(network=0.7, box=0.3, reflectance=0.5)
OTHER_LAYERS = from_lists([[RNG.normal(size=(N_BOTH, 4)), RNG.normal(size=4)]], N_BOTH)


def metadata_of(classifiers):
    """Metadata entry of classifiers by their scales."""
    return json.dumps({scale: classifier_entry(*parts) for scale, parts in classifiers.items()})


METADATA = {
    METADATA_KEY: metadata_of(
        {"hdl-64e": (LAYERS, PoolWeights(reflectance=0.5)), "pandar64": (OTHER_LAYERS, PoolWeights(reflectance=0.8))}
    )
}


def measured():
    """Three proposals with reflectance."""
    _, proposals = blobs([10, 30, 60])
    return replace(proposals, reflectance=REFLECTANCE)


def prior_with_reflectance(scale="hdl-64e"):
    """The prior with the reflectance of a sensor's scale."""
    sensor = SensorConfig(reflectance=scale)
    return BoxPrior(BoxScores(BOXES, from_metadata(METADATA, sensor), sensor), FREQUENCY)


def test_prior_is_box_probability_times_reflectance_likelihood_by_the_classifier_of_the_sensors_scale():
    proposals = measured()
    boxes = proposal_features(proposals, SENSOR)
    for scale, layers, weight in (("hdl-64e", LAYERS, 0.5), ("pandar64", OTHER_LAYERS, 0.8)):
        prior = prior_with_reflectance(scale)
        expected = softmax(logits(BOX_LAYERS, boxes) + logits(layers, np.c_[boxes, REFLECTANCE]), axis=1)
        assert_allclose(prior.probability(proposals), expected)
        classifier = from_metadata(METADATA, SensorConfig(reflectance=scale))
        assert classifier.weights == PoolWeights(reflectance=weight)


def test_a_sweep_without_reflectance_adds_nothing_and_warns_once(caplog):
    prior = prior_with_reflectance()
    bare = blobs([10, 30], RNG)[1]
    with caplog.at_level(logging.WARNING):
        assert prior.probability(Proposals.empty()).shape == (0, 4)
        assert not caplog.records  # a frame without proposals does not say whether the sensor measures it
        for _ in range(3):
            probability = prior.probability(bare)
            assert_array_equal(probability, WITHOUT.probability(bare))
    assert len(caplog.records) == 1
    assert "sensor.reflectance" in caplog.text


def test_a_proposal_without_reflectance_does_not_affect_the_others():
    prior = prior_with_reflectance()
    whole = measured()
    statistics = REFLECTANCE.copy()
    statistics[1] = np.nan
    probability = prior.probability(replace(whole, reflectance=statistics))
    assert_array_equal(probability[1], WITHOUT.probability(whole)[1])
    assert_array_equal(probability[[0, 2]], prior.probability(whole)[[0, 2]])


MALFORMED = "{}", "[]", "no json", '{"hdl-64e": null}', metadata_of({"hdl-46e": (LAYERS, WEIGHTS)})


@pytest.mark.parametrize("text", [*MALFORMED, metadata_of({"hdl-64e": (LAYERS, PoolWeights(reflectance=2.0))})])
def test_malformed_metadata_is_rejected(text):
    with pytest.raises((KeyError, TypeError, ValueError)):
        from_metadata({METADATA_KEY: text}, SENSOR)


def _with_metadata(path, metadata):
    """The shipped model with other metadata."""
    onnx = pytest.importorskip("onnx", reason="extra [train] is not installed")
    model = onnx.load(classifier().model.path)
    onnx.helper.set_model_props(model, metadata)
    path.write_bytes(model.SerializeToString())
    return path


def test_network_box_and_reflectance_are_pooled(tmp_path):
    points, _ = blobs([10, 30, 60])
    proposals = measured()
    which = np.array([2, 0])
    metadata = {
        box_classifier.METADATA_KEY: json.dumps(classifier_entry(BOX_LAYERS, PoolWeights(0.8, 0.2))),
        METADATA_KEY: metadata_of({"hdl-64e": (LAYERS, WEIGHTS)}),
        CLASS_FREQUENCY_KEY: json.dumps(FREQUENCY.tolist()),
    }
    alone = classifier(_with_metadata(tmp_path / "alone.onnx", {}), SENSOR)
    model = _with_metadata(tmp_path / "pooled.onnx", metadata)
    shape = alone.classify(points, proposals, which)
    feature = proposal_features(proposals, SENSOR)[which]
    box = np.exp(logits(BOX_LAYERS, feature))
    likelihood = np.exp(logits(LAYERS, np.c_[feature, REFLECTANCE[which]]))
    object_ = (box[:, 1:].sum(axis=1) / box[:, 0]) / (FREQUENCY[1:].sum() / FREQUENCY[0])
    either = np.c_[np.ones(2), np.tile(object_[:, None], 3)]  # the same for every class of object
    bare = replace(proposals, reflectance=None)
    with_box = FREQUENCY * (shape / FREQUENCY) ** 0.8 * either**0.2
    for sensor, given, expected, weight in (
        (SENSOR, proposals, FREQUENCY * (shape / FREQUENCY) ** 0.7 * either**0.3 * likelihood**0.5, 0.3),
        (SENSOR, bare, with_box, 0.2),
        (SensorConfig(), proposals, with_box, 0.2),
    ):
        network = classifier(model, sensor)
        probability = network.classify(points, given, which)
        assert_allclose(probability, expected / expected.sum(axis=1, keepdims=True), rtol=1e-5)
        prior = make_prior(network.box_scores, FREQUENCY)
        assert prior.pool_weight(given) == weight


def test_shipped_model_separates_number_plates_from_leaves():
    model = classifier(sensor=SENSOR)
    reflectance = model.box_scores.reflectance
    assert reflectance is not None
    _, proposals = blobs([150])
    box = np.array([[18.0, 0.0, -0.8, 3.9, 1.6, 1.3, 0.0]])
    proposals = replace(proposals, box=box)
    plates = np.array([[0.16, 0.22, 0.99, 0.04, 0.45]])
    leaves = np.array([[0.33, 0.12, 0.6, 0.0, 0.07]])
    prior = make_prior(model.box_scores, FREQUENCY)
    car, bush = (prior.probability(replace(proposals, reflectance=statistics))[0] for statistics in (plates, leaves))
    assert car[ObjectClass.CAR] > 0.9
    assert bush[ObjectClass.CAR] < 0.3


def test_what_the_view_cuts_is_judged_by_the_network_beside_the_model(tmp_path):
    onnx = pytest.importorskip("onnx", reason="extra [train] is not installed")
    points, blob = blobs([10, 30, 60])
    box = blob.box.copy()
    box[:, 2] = -1.0
    box[:, 5] = 0.5  # lower than a person
    proposals = replace(blob, box=box, cut=np.array([Cut.TOP, 0, Cut.TOP]))
    whole = replace(proposals, cut=np.zeros(3, np.int64))
    metadata = {box_classifier.METADATA_KEY: json.dumps(classifier_entry(BOX_LAYERS, PoolWeights(0.8, 0.2)))}
    model = _with_metadata(tmp_path / "net.onnx", metadata)

    def classified(given, *which):
        return classifier(model).classify(points, given, np.array(which))

    alone = classified(proposals, 0, 1, 2)
    assert_array_equal(classified(whole, 0, 1, 2), alone)

    beside = onnx.load(tmp_path / "net.onnx")
    last = next(i for i in beside.graph.initializer if i.name == "bias5")
    last.CopyFrom(onnx.numpy_helper.from_array(np.float32([0.0, 0.0, 30.0, 0.0]), "bias5"))  # all are people
    bounds = [(np.zeros((box_classifier.N_BOUND_FEATURES, 4)), np.zeros(4))]
    text = {box_classifier.BOUNDS_KEY: json.dumps(to_lists(bounds))}
    onnx.helper.set_model_props(beside, text)
    (tmp_path / "net-near.onnx").write_bytes(beside.SerializeToString())
    found = classified(proposals, 2, 1, 0)
    assert (found[[0, 2], ObjectClass.PEDESTRIAN] > 0.99).all()
    assert_array_equal(found[1], alone[1])
    assert_array_equal(classified(whole, 0, 1, 2), alone)
    onnx.helper.set_model_props(beside, {box_classifier.BOUNDS_KEY: "[]"})
    (tmp_path / "net-near.onnx").write_bytes(beside.SerializeToString())
    with pytest.raises(MisuseError, match="malformed box"):
        classified(proposals, 0)
