"""What the brightness of returns adds to what is thought of a proposal."""

from __future__ import annotations

import dataclasses
import json
import logging
from pathlib import Path

import numpy as np
import pytest

from modt.classes import ObjectClass
from modt.classification.box_classifier import METADATA as BOX_PRIOR
from modt.classification.box_classifier import N_FEATURES, KnownBoxes, described
from modt.classification.box_classifier import encode as encode_boxes
from modt.classification.mlp import logits
from modt.classification.pointnet import PointNet
from modt.classification.prior import BoxPrior, prior_of
from modt.classification.reflectance_classifier import METADATA, NoEvidence, Reflectance, encode, evidence_of
from modt.config import ClassificationConfig, SensorConfig
from modt.errors import MisuseError
from modt.types import N_REFLECTANCE, Proposals
from tests.classification.scenes import blobs

RNG = np.random.default_rng(6)
BOX_LAYERS = [(RNG.normal(size=(N_FEATURES, 4)), RNG.normal(size=4))]
BOXES = KnownBoxes(BOX_LAYERS, 0.0)
LAYERS = [(RNG.normal(size=(N_FEATURES + N_REFLECTANCE, 4)), RNG.normal(size=4))]
BRIGHTNESS = RNG.uniform(0, 1, (3, N_REFLECTANCE))
SENSOR = SensorConfig(reflectance="hdl-64e")
HELD = {METADATA: encode(LAYERS, 0.0, 0.5, "hdl-64e")}


def lit() -> Proposals:
    """Three proposals whose returns were measured."""
    _, proposals = blobs([10, 30, 60], np.random.default_rng(0))
    return dataclasses.replace(proposals, reflectance=BRIGHTNESS)


def test_the_prior_takes_all_of_it() -> None:
    proposals = lit()
    boxes = described(proposals, slice(None), SENSOR)
    score = logits(BOX_LAYERS, boxes) + logits(LAYERS, np.c_[boxes, BRIGHTNESS])
    expected = np.exp(score) / np.exp(score).sum(axis=1, keepdims=True)
    evidence = evidence_of(HELD, N_FEATURES, SENSOR)
    prior = prior_of(BOXES, (0.1, 0.1, 0.1), SENSOR, evidence)
    np.testing.assert_allclose(prior.of(proposals), expected)


def test_a_sensor_on_another_scale_and_a_model_without_it_go_by_shape() -> None:
    for metadata, sensor in ((HELD, SensorConfig()), ({}, SENSOR)):
        evidence = evidence_of(metadata, N_FEATURES, sensor)
        assert isinstance(evidence, NoEvidence)
        assert evidence.weight == 0
        assert not evidence.of(np.ones((3, N_FEATURES)), BRIGHTNESS).any()


def test_a_sweep_without_reflectance_goes_by_shape_and_says_so_once(caplog: pytest.LogCaptureFixture) -> None:
    evidence = evidence_of(HELD, N_FEATURES, SENSOR)
    bare = dataclasses.replace(lit(), reflectance=None)
    with caplog.at_level(logging.WARNING):
        for _ in range(3):
            np.testing.assert_array_equal(
                BoxPrior(BOXES, SENSOR, evidence).of(bare), BoxPrior(BOXES, SENSOR, NoEvidence()).of(bare)
            )
    assert len(caplog.records) == 1
    assert "sensor.reflectance" in caplog.text


def test_a_proposal_without_reflectance_goes_by_shape_and_the_others_do_not_mind() -> None:
    evidence = evidence_of(HELD, N_FEATURES, SENSOR)
    prior, whole = BoxPrior(BOXES, SENSOR, evidence), lit()
    told = BRIGHTNESS.copy()
    told[1] = np.nan
    found = prior.of(dataclasses.replace(whole, reflectance=told))
    np.testing.assert_array_equal(found[1], BoxPrior(BOXES, SENSOR, NoEvidence()).of(whole)[1])
    np.testing.assert_array_equal(found[[0, 2]], prior.of(whole)[[0, 2]])


def test_an_empty_frame_is_no_lack_of_reflectance(caplog: pytest.LogCaptureFixture) -> None:
    evidence = evidence_of(HELD, N_FEATURES, SENSOR)
    assert BoxPrior(BOXES, SENSOR, evidence).of(Proposals.empty()).shape == (0, 4)
    assert not caplog.records


@pytest.mark.parametrize(
    "text",
    [
        "{}",
        "[]",
        "no json",
        json.dumps({"sensor": "hdl-64e", "share": 0.5, "weight": 2.0, "layers": []}),
        json.dumps({"sensor": "hdl-64e", "share": -0.5, "weight": 0.5, "layers": []}),
        json.dumps({"sensor": "hdl-64e", "share": 0.5, "weight": 0.5, "layers": []}),
    ],
)
def test_evidence_that_cannot_be_used_is_refused(text: str) -> None:
    with pytest.raises((KeyError, TypeError, ValueError)):
        evidence_of({METADATA: text}, N_FEATURES, SENSOR)


def _with_metadata(path: Path, metadata: dict[str, str]) -> ClassificationConfig:
    """The model that ships with another metadata."""
    onnx = pytest.importorskip("onnx", reason="extra [train] is not installed")
    model = onnx.load(PointNet(ClassificationConfig(), SensorConfig()).path)
    onnx.helper.set_model_props(model, metadata)
    path.write_bytes(model.SerializeToString())
    return ClassificationConfig(model=str(path))


def test_the_network_takes_its_share_by_bayes_rule(tmp_path: Path) -> None:
    points, _ = blobs([10, 30, 60], np.random.default_rng(0))
    proposals, which = lit(), np.array([2, 0])
    dark, seen = (PointNet(_with_metadata(tmp_path / f"{i}.onnx", held), SENSOR) for i, held in enumerate(({}, HELD)))
    shape, both = (network.classify(points, proposals, which) for network in (dark, seen))
    added = logits(LAYERS, np.c_[described(proposals, which, SENSOR), BRIGHTNESS[which]])
    expected = shape * np.exp(0.5 * added)
    np.testing.assert_allclose(both, expected / expected.sum(axis=1, keepdims=True), rtol=1e-5)
    bare = dataclasses.replace(proposals, reflectance=None)
    np.testing.assert_allclose(seen.classify(points, bare, which), shape, rtol=1e-5)


def test_network_box_and_reflectance_are_pooled(tmp_path: Path) -> None:
    points, _ = blobs([10, 30, 60], np.random.default_rng(0))
    proposals, which = lit(), np.array([2, 0])
    held = {BOX_PRIOR: encode_boxes(BOX_LAYERS, 0.2), METADATA: encode(LAYERS, 0.3, 0.5, "hdl-64e")}
    alone = PointNet(_with_metadata(tmp_path / "alone.onnx", {}), SENSOR)
    model = _with_metadata(tmp_path / "held.onnx", held)
    shape, feature = alone.classify(points, proposals, which), described(proposals, which, SENSOR)
    box, told = np.exp(logits(BOX_LAYERS, feature)), np.exp(logits(LAYERS, np.c_[feature, BRIGHTNESS[which]]))
    for sensor, expected in ((SENSOR, shape**0.7 * box**0.3 * told**0.5), (SensorConfig(), shape**0.8 * box**0.2)):
        network = PointNet(model, sensor)
        word = network.classify(points, proposals, which)
        np.testing.assert_allclose(word, expected / expected.sum(axis=1, keepdims=True), rtol=1e-5)
        prior = prior_of(network.boxes, (0.1, 0.1, 0.1), sensor, network.evidence)
        assert prior.share == (0.3 if sensor is SENSOR else 0.2)


@pytest.mark.parametrize("key", [METADATA, BOX_PRIOR])
def test_a_model_that_holds_nonsense_is_misuse(tmp_path: Path, key: str) -> None:
    with pytest.raises(MisuseError, match="boxes and reflectance"):
        PointNet(_with_metadata(tmp_path / "model.onnx", {key: "{}"}), SENSOR)


def test_the_model_that_ships_knows_number_plates_from_leaves() -> None:
    model = PointNet(ClassificationConfig(), SENSOR)
    evidence = model.evidence
    assert isinstance(evidence, Reflectance)
    _, proposals = blobs([150], np.random.default_rng(0))
    box = np.array([[18.0, 0.0, -0.8, 3.9, 1.6, 1.3, 0.0]])
    seen = dataclasses.replace(proposals, box=box)
    plates, leaves = np.array([[0.16, 0.22, 0.99, 0.04, 0.45]]), np.array([[0.33, 0.12, 0.6, 0.0, 0.07]])
    prior = prior_of(model.boxes, (0.08, 0.02, 0.02), SENSOR, evidence)
    car, bush = (prior.of(dataclasses.replace(seen, reflectance=told))[0] for told in (plates, leaves))
    assert car[ObjectClass.CAR] > 0.9
    assert bush[ObjectClass.CAR] < 0.3
