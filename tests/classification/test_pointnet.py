"""The network: independent of batching, strict about its model file."""

from __future__ import annotations

import dataclasses
import shutil
from itertools import pairwise

import numpy as np
import onnx
import pytest
from numpy.testing import assert_allclose
from scipy.special import softmax

from modt import assets
from modt.classification.network import Network
from modt.classification.pointnet import CLASS_FREQUENCY_KEY
from modt.config import SensorConfig
from modt.errors import MisuseError
from modt_training.export_pointnet import graph
from tests.classification.scenes import blobs, classifier, saved
from tests.fuzz.runs import network

SIZES = (3, 32, 64, 512, 256, 128, 4)


def random_layers(seed):
    rng = np.random.default_rng(seed)
    layers = [(rng.normal(size=(a, b)) * np.sqrt(2 / a), rng.normal(0, 0.3, b)) for a, b in pairwise(SIZES)]
    return [(weight.astype(np.float32), bias.astype(np.float32)) for weight, bias in layers]


def textbook(layers, xyz):
    """Slow reference: one crop, bias and ReLU on every point before the maximum, in double precision."""
    h = xyz.astype(np.float64)
    for weight, bias in layers[:3]:
        h = np.maximum(h @ weight + bias, 0)
    h = h.max(axis=0)
    for weight, bias in layers[3:-1]:
        h = np.maximum(h @ weight + bias, 0)
    weight, bias = layers[-1]
    return softmax(h @ weight + bias)


@pytest.fixture(scope="module")
def shipped():
    return classifier()


@pytest.mark.parametrize("pool_first", [True, False])
def test_the_exported_graph_agrees_with_the_textbook(tmp_path, pool_first):
    layers = random_layers(1)
    net = classifier(saved(tmp_path, graph(layers, pool_first=pool_first)))
    rng = np.random.default_rng(2)
    for points in (1, 2, 5, 50, 400, 1000):
        batch = rng.normal(0, 1.5, (3, points, 3)).astype(np.float32)
        expected = [textbook(layers, crop) for crop in batch]
        assert_allclose(net.network.infer(batch), expected, atol=1e-4)


def test_result_is_independent_of_batch_and_order(shipped):
    points, proposals = blobs([5, 300, 17, 17, 90, 1, 450, 33, 60, 8, 12])
    rows = np.arange(len(proposals))
    together = shipped.classify(points, proposals, rows)
    alone = np.concatenate([shipped.classify(points, proposals, rows[i : i + 1]) for i in rows])
    assert_allclose(together, alone, atol=1e-5)
    assert (together >= 0).all()
    assert_allclose(together.sum(axis=1), 1.0, atol=1e-5)
    assert_allclose(shipped.classify(points, proposals, rows[::-1]), together[::-1], atol=1e-5)


@pytest.mark.parametrize("likelihood", ["network", "pooled"])
def test_ground_of_the_proposals_overrides_the_profile(likelihood):
    low = classifier(sensor=SensorConfig(height_m=0.4), likelihood=likelihood)
    unknown = classifier(sensor=SensorConfig(height_m=None), likelihood=likelihood)
    points, proposals = blobs([40, 7, 200], 5)
    rows = np.arange(3)
    measured = dataclasses.replace(proposals, ground_z_m=np.full(3, -0.4))
    expected = low.classify(points, proposals, rows)
    assert np.array_equal(unknown.classify(points, measured, rows), expected)
    assert not np.allclose(unknown.classify(points, proposals, rows), expected, atol=1e-3)


def test_the_papers_network_stands_alone_and_takes_a_fixed_number_of_points(shipped, monkeypatch):
    points, proposals = blobs([40, 7, 500], 4)
    paper = classifier(shipped.model.path, max_points=400, likelihood="network")
    sizes = []
    assert paper.box_scores.boxes is None
    bare = classifier(shipped.model.path, max_points=400)
    bare._pooled = lambda out, *_: out
    expected = bare.classify(points, proposals, np.arange(3))
    infer = Network.infer
    monkeypatch.setattr(Network, "infer", lambda self, batch: (sizes.append(batch.shape[:2]), infer(self, batch))[1])
    assert_allclose(paper.classify(points, proposals, np.arange(3)), expected, atol=1e-5)
    assert sizes == [(1, 400)] * 3


@pytest.mark.parametrize("name", [path.stem for path in assets.shipped("models", ".onnx")])
def test_every_model_has_a_card_with_its_hash_and_licence(name):
    model = classifier(name).model
    card = model.path.with_suffix(".md").read_text(encoding="utf-8")
    assert model.sha256 in card
    assert "licence:" in card


def test_model_that_differs_from_its_card_is_misuse(tmp_path, shipped):
    model = saved(tmp_path, graph(random_layers(0)))
    shutil.copy(shipped.model.path.with_suffix(".md"), model.with_suffix(".md"))
    with pytest.raises(MisuseError, match=r"net\.onnx: is not the model of net\.md"):
        classifier(model)


@pytest.mark.parametrize(
    "frequency", ["[0.5, 0.2, 0.2]", "[0.7, 0.3, 0.0, 0.1]", "[0.7, 0.5, 0.4, 0.3]", "[0.7, NaN, 0.1, 0.1]"]
)
def test_malformed_class_frequency_is_misuse(tmp_path, frequency):
    model = graph(random_layers(0))
    onnx.helper.set_model_props(model, {CLASS_FREQUENCY_KEY: frequency})
    with pytest.raises(MisuseError, match="class frequency"):
        classifier(saved(tmp_path, model))


@pytest.mark.parametrize("width", [(4, 4), (3, 5)])
def test_model_of_other_shapes_is_misuse(tmp_path, width):
    model = network()
    model.graph.input[0].type.tensor_type.shape.dim[2].dim_value = width[0]
    model.graph.output[0].type.tensor_type.shape.dim[1].dim_value = width[1]
    model.graph.initializer[0].CopyFrom(onnx.numpy_helper.from_array(np.zeros(width, np.float32), "w"))
    with pytest.raises(MisuseError, match="inputs and outputs"):
        classifier(saved(tmp_path, model))
