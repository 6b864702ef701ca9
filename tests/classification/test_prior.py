"""Priors by class frequency and by box."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from modt.classes import ObjectClass
from modt.classification.box_classifier import (
    METADATA_KEY,
    N_FEATURES,
    MlpBoxClassifier,
    NoBoxClassifier,
    box_features,
    from_lists,
    from_metadata,
    to_metadata,
)
from modt.classification.pointnet import PointNet
from modt.classification.pool import PoolWeights
from modt.classification.prior import BoxPrior, BoxScores, FrequencyPrior, make_prior
from modt.classification.reflectance_classifier import NoReflectanceClassifier
from modt.config import ClassificationConfig, SensorConfig
from modt.types import Proposals
from tests.classification.scenes import blobs

RNG = np.random.default_rng(5)
FREQUENCY = np.array([0.88, 0.08, 0.02, 0.02])
WEIGHTS = PoolWeights(network=0.8, box=0.4)
SHAPES = ((N_FEATURES, 5), (5, 4))
LAYERS = from_lists([[RNG.normal(size=shape), RNG.normal(size=shape[1])] for shape in SHAPES], N_FEATURES)
BOXES = MlpBoxClassifier(LAYERS, WEIGHTS)
NO_REFLECTANCE = NoReflectanceClassifier()
SCORES = BoxScores(BOXES, NO_REFLECTANCE, SensorConfig())
SHIPPED = ("pointnet-kitti", "pointnet-synthetic")


def standing(points: int, distance_m: float, length_m: float, width_m: float, height_m: float) -> Proposals:
    """One proposal on the ground ahead of a sensor at 1.73 m."""
    _, proposals = blobs([points], np.random.default_rng(0))
    foot_m = 0.3
    box = np.array([[distance_m, 0.0, foot_m + height_m / 2 - 1.73, length_m, width_m, height_m, 0.0]])
    return dataclasses.replace(proposals, box=box)


def test_box_prior_excludes_proposals_below_the_threshold() -> None:
    probability = np.array([[0.995, 0.005, 0.0, 0.0], [0.97, 0.01, 0.01, 0.01], [0.1, 0.9, 0.0, 0.0]])
    prior = BoxPrior(SCORES, FREQUENCY)
    assert prior.may_be_object(probability, 0.02).tolist() == [False, True, True]


def test_prior_is_the_class_frequency_without_a_box_classifier() -> None:
    _, proposals = blobs([10, 20], np.random.default_rng(0))
    prior = make_prior(
        BoxScores(NoBoxClassifier(), NO_REFLECTANCE, SensorConfig()), np.array([0.89, 0.08, 0.02, 0.01])
    )
    np.testing.assert_allclose(prior.probability(proposals), [[0.89, 0.08, 0.02, 0.01]] * 2)
    assert prior.may_be_object(prior.probability(proposals), 1.0).all()
    assert isinstance(prior, FrequencyPrior)
    boxes = from_metadata({METADATA_KEY: to_metadata(LAYERS, WEIGHTS)})
    by_box = make_prior(BoxScores(boxes, NO_REFLECTANCE, SensorConfig()), FREQUENCY)
    assert isinstance(by_box, BoxPrior)
    assert (prior.pool_weight, by_box.pool_weight) == (0.0, 0.4)


def test_features_are_independent_of_the_resolution() -> None:
    near = standing(40, 20.0, 4.0, 1.6, 1.4)
    fine = box_features(np.array([160]), near.box, np.array([-1.73]), np.deg2rad(0.1) * np.deg2rad(0.2))
    coarse = box_features(np.array([40]), near.box, np.array([-1.73]), np.deg2rad(0.2) * np.deg2rad(0.4))
    np.testing.assert_allclose(fine, coarse)


def test_ground_of_the_proposals_overrides_the_profile() -> None:
    sensors = (SensorConfig(height_m=height_m) for height_m in (1.0, 2.0))
    low, high = (BoxPrior(BoxScores(BOXES, NO_REFLECTANCE, sensor), FREQUENCY) for sensor in sensors)
    unknown = standing(40, 20.0, 4.0, 1.6, 1.4)
    measured = dataclasses.replace(unknown, ground_z_m=np.array([-2.0]))
    assert (low.probability(measured) == high.probability(unknown)).all()
    assert (low.probability(measured) != low.probability(unknown)).all()


@pytest.mark.parametrize("name", SHIPPED)
def test_box_priors_of_the_shipped_models(name: str) -> None:
    sensor = SensorConfig()
    model = PointNet(ClassificationConfig(model=name), sensor)
    prior = make_prior(model.box_scores, FREQUENCY)
    car = prior.probability(standing(300, 12.0, 4.0, 1.6, 1.3))[0]
    person = prior.probability(standing(120, 12.0, 0.6, 0.5, 1.4))[0]
    wall = prior.probability(standing(600, 15.0, 12.0, 0.5, 2.3))[0]
    speck = prior.probability(standing(5, 15.0, 0.1, 0.1, 0.3))[0]
    assert car.argmax() == ObjectClass.CAR
    assert person[ObjectClass.PEDESTRIAN] > 0.1
    assert max(1 - wall[0], 1 - speck[0]) < 0.02


def test_no_proposals_give_no_priors() -> None:
    assert BoxPrior(SCORES, FREQUENCY).probability(Proposals.empty()).shape == (0, 4)
    assert FrequencyPrior(FREQUENCY).probability(Proposals.empty()).shape == (0, 4)


@pytest.mark.parametrize(
    "entry",
    [
        "[]",
        "no json",
        "{}",
        '{"weights": {"network": 1.5, "box": 0.5, "reflectance": 0}, "layers": []}',
        '{"weights": {"network": 0.5, "box": 0.5}, "layers": []}',
        '{"weights": {"network": 0.5, "box": 0.5, "reflectance": 0}, "layers": []}',
    ],
)
def test_malformed_metadata_is_rejected(entry: str) -> None:
    with pytest.raises((KeyError, TypeError, ValueError)):
        from_metadata({METADATA_KEY: entry})


def test_box_classifier_round_trips_through_metadata() -> None:
    features = RNG.normal(size=(6, N_FEATURES))
    loaded = from_metadata({METADATA_KEY: to_metadata(LAYERS, WEIGHTS)})
    whole = np.zeros(6, np.int64)
    np.testing.assert_array_equal(loaded.log_probability(features, whole), BOXES.log_probability(features, whole))
    assert loaded.weights == WEIGHTS
    assert not from_metadata({}).log_probability(features, whole).any()
