"""What is thought of a proposal before its points are looked at."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from modt.classes import ObjectClass
from modt.classification.box_classifier import (
    METADATA,
    N_FEATURES,
    KnownBoxes,
    NoBoxes,
    beam_sr,
    boxes_of,
    encode,
    features,
)
from modt.classification.pointnet import PointNet
from modt.classification.prior import BoxPrior, Frequency, prior_of
from modt.classification.reflectance_classifier import NoEvidence
from modt.config import ClassificationConfig, SensorConfig
from modt.types import Proposals
from tests.classification.scenes import blobs

RNG = np.random.default_rng(5)
LAYERS = [(RNG.normal(size=(N_FEATURES, 5)), RNG.normal(size=5)), (RNG.normal(size=(5, 4)), RNG.normal(size=4))]
BOXES = KnownBoxes(LAYERS, 0.4)
SHIPPED = ("pointnet-kitti", "pointnet-synthetic")


def standing(points: int, distance_m: float, length_m: float, width_m: float, height_m: float) -> Proposals:
    """One proposal on the ground ahead of a sensor at 1.73 m."""
    _, proposals = blobs([points], np.random.default_rng(0))
    foot_m = 0.3
    box = np.array([[distance_m, 0.0, foot_m + height_m / 2 - 1.73, length_m, width_m, height_m, 0.0]])
    return dataclasses.replace(proposals, box=box)


def test_a_box_is_ruled_out_below_a_threshold() -> None:
    said = np.array([[0.995, 0.005, 0.0, 0.0], [0.97, 0.01, 0.01, 0.01], [0.1, 0.9, 0.0, 0.0]])
    assert BoxPrior(BOXES, SensorConfig(), NoEvidence()).likely(said, 0.02).tolist() == [False, True, True]


def test_without_one_the_classes_are_as_common_as_they_are() -> None:
    _, proposals = blobs([10, 20], np.random.default_rng(0))
    prior = prior_of(NoBoxes(), (0.08, 0.02, 0.01), SensorConfig(), NoEvidence())
    np.testing.assert_allclose(prior.of(proposals), [[0.89, 0.08, 0.02, 0.01]] * 2)
    assert prior.likely(prior.of(proposals), 1.0).all()  # it rules nothing out
    assert isinstance(prior, Frequency)
    known = prior_of(boxes_of({METADATA: encode(LAYERS, 0.4)}), (0.1, 0.1, 0.1), SensorConfig(), NoEvidence())
    assert isinstance(known, BoxPrior)
    assert (prior.share, known.share) == (0.0, 0.4)


def test_sensors_of_different_resolution_see_alike() -> None:
    near = standing(40, 20.0, 4.0, 1.6, 1.4)
    fine = features(np.array([160]), near.box, 1.73, beam_sr(0.1, 0.2))
    coarse = features(np.array([40]), near.box, 1.73, beam_sr(0.2, 0.4))
    np.testing.assert_allclose(fine, coarse)


def test_the_height_at_which_proposals_were_found_goes_before_that_of_the_profile() -> None:
    prior = BoxPrior(BOXES, SensorConfig(height_m=1.0), NoEvidence())
    seen = standing(40, 20.0, 4.0, 1.6, 1.4)
    found = dataclasses.replace(seen, sensor_height_m=2.0)
    assert (prior.of(found) == BoxPrior(BOXES, SensorConfig(height_m=2.0), NoEvidence()).of(seen)).all()
    assert (prior.of(found) != prior.of(seen)).all()


@pytest.mark.parametrize("name", SHIPPED)
def test_the_models_that_ship_know_what_is_no_object(name: str) -> None:
    sensor = SensorConfig()
    model = PointNet(ClassificationConfig(model=name), sensor)
    prior = prior_of(model.boxes, (0.08, 0.02, 0.02), sensor, model.evidence)
    car = prior.of(standing(300, 12.0, 4.0, 1.6, 1.3))[0]
    person = prior.of(standing(120, 12.0, 0.6, 0.5, 1.4))[0]
    wall = prior.of(standing(600, 15.0, 12.0, 0.5, 2.3))[0]
    speck = prior.of(standing(5, 60.0, 0.1, 0.1, 0.3))[0]
    assert car.argmax() == ObjectClass.CAR
    assert person[ObjectClass.PEDESTRIAN] > 0.1
    assert max(1 - wall[0], 1 - speck[0]) < 0.02


def test_an_empty_frame_has_no_priors() -> None:
    assert BoxPrior(BOXES, SensorConfig(), NoEvidence()).of(Proposals.empty()).shape == (0, 4)
    assert Frequency((0.1, 0.1, 0.1)).of(Proposals.empty()).shape == (0, 4)


@pytest.mark.parametrize(
    "held", ["[]", "no json", "{}", '{"share": 1.5, "layers": []}', '{"share": 0.5, "layers": []}']
)
def test_knowledge_of_boxes_that_cannot_be_used_is_refused(held: str) -> None:
    with pytest.raises((KeyError, TypeError, ValueError)):
        boxes_of({METADATA: held})


def test_what_is_known_of_boxes_comes_back_from_the_metadata() -> None:
    feature = RNG.normal(size=(6, N_FEATURES))
    held = boxes_of({METADATA: encode(LAYERS, 0.4)})
    np.testing.assert_array_equal(held.of(feature), BOXES.of(feature))
    assert held.share == 0.4
    assert not boxes_of({}).of(feature).any()
