"""Box features of crops (training) and of proposals (run time) agree; training of box and reflectance classifiers."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from modt.classification.box_classifier import N_FEATURES, proposal_features
from modt.classification.crops import Crops, gather, ground_z_m
from modt.config import SegmentationConfig, SensorConfig
from modt.geometry import FieldOfView
from modt.segmentation.segmenter import Segmenter
from modt.types import N_REFLECTANCE, Float64, Int
from modt_desk.simulation.synthetic_stream import SyntheticStream
from tests.tools.train.datasets import data_of, truth_of
from tools.train.dataset import Dataset, Sensors, crop_features, dataset_features


def test_features_of_crops_and_proposals_agree() -> None:
    sensor = SensorConfig()
    frame = next(iter(SyntheticStream("street", "hdl-64e", 0.1, seed=4)))
    proposals = Segmenter(SegmentationConfig(), sensor, FieldOfView()).segment(frame.points)
    crops = gather(frame.points, proposals, np.arange(len(proposals)), 100_000)
    expected = proposal_features(proposals, sensor)
    assert len(crops) > 50
    off = np.abs(
        crop_features(crops, Sensors.of(sensor, proposals.box, ground_z_m(proposals, slice(None), sensor))) - expected
    )
    assert off[:, 4:].max() < 1e-3  # height, foot and top
    assert np.quantile(off[:, :4], 0.9, axis=0).max() < 0.15  # at run time headings are fitted to fewer points


def cubes(sides_m: Float64, label: Int, rng: np.random.Generator) -> Dataset:
    """Cubes of the given sides, ten metres ahead, in four drives."""
    n = len(sides_m)
    xyz = (rng.uniform(-0.5, 0.5, (n, 60, 3)) * sides_m[:, None, None] + [10.0, 0.0, -1.0]).reshape(-1, 3)
    crops = Crops(xyz.astype(np.float32), np.arange(n + 1) * 60)
    drive = np.arange(n) % 4
    return data_of(crops, label, drive=drive, truth=truth_of(label, drive, row=np.arange(n)))


def test_training_separates_classes_by_size() -> None:
    pytest.importorskip("torch", reason="extra [train] is not installed")
    from modt.classification.box_classifier import logits
    from tools.train.train_box_classifier import cross_validate, train

    rng = np.random.default_rng(0)
    label = np.arange(80) // 2 % 4
    data = cubes(0.1 * 4.0**label, label, rng)
    layers = train(data, np.arange(80), 150, seed=1)
    again = train(data, np.arange(80), 150, seed=1)
    feature = dataset_features(data, np.arange(80))
    assert feature.shape == (80, N_FEATURES)
    assert np.mean(logits(layers, feature).argmax(axis=1) == label) > 0.9
    assert all(
        (a == b).all() for one, other in zip(layers, again, strict=True) for a, b in zip(one, other, strict=True)
    )
    _, report = cross_validate(data, np.full((80, 4), 0.25), 2, 150, seed=1)
    assert min(report["cross_validation"]["hdl-64e"]["average_precision"].values()) > 0.8
    assert report["weights"]["box"] > 0.9  # a network that knows nothing leaves all of it


def test_training_separates_classes_by_reflectance() -> None:
    pytest.importorskip("torch", reason="extra [train] is not installed")
    from modt.classification.box_classifier import logits
    from tools.train.train_reflectance_classifier import cross_validate, features_of, has_reflectance, on_scale, train

    rng = np.random.default_rng(0)
    label = np.arange(160) // 2 % 4
    alike = cubes(np.ones(160), label, rng)
    told = rng.normal(0.2 * label, 0.03, (N_REFLECTANCE, 160)).T
    told[::20] = np.nan  # not measured
    data = on_scale(dataclasses.replace(alike, reflectance=told), "hdl-64e")
    features = features_of(data)
    dumb = [(np.zeros((N_FEATURES, 4)), np.zeros(4))]
    layers = train(data, features, np.arange(160), dumb, 200, seed=1)
    known = np.isfinite(told).all(axis=1)
    assert np.mean(logits(layers, features[known]).argmax(axis=1) == label[known]) > 0.9

    assert not has_reflectance(on_scale(data, "pandar64"), np.arange(160)).any()

    data = dataclasses.replace(alike, reflectance=np.nan_to_num(told, nan=0.3))
    network = np.full((160, 4), 0.25)
    _, report = cross_validate(data, features_of(data), network, 2, 200, seed=1)
    assert report["weights"]["reflectance"] > 0.9  # a network that knows nothing leaves all of it
    assert min(report["pool"]["hdl-64e"]["average_precision"].values()) > 0.7
