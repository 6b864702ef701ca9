"""Priors by class frequency and by box."""

from __future__ import annotations

import dataclasses
from itertools import pairwise

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from modt.classes import ObjectClass
from modt.classification.box_classifier import N_FEATURES, BoxClassifier, proposal_features
from modt.classification.pool import PoolWeights
from modt.classification.prior import BoxScores, FrequencyPrior, make_prior
from modt.config import SensorConfig
from modt.types import Proposals
from tests.classification.scenes import blobs, classifier

RNG = np.random.default_rng(5)
FREQUENCY = np.array([0.88, 0.08, 0.02, 0.02])
LAYERS = [(RNG.normal(size=shape), RNG.normal(size=shape[1])) for shape in pairwise((N_FEATURES, 5, 4))]
SENSOR = SensorConfig(height_m=1.73)
BOXES = BoxClassifier(LAYERS, PoolWeights(network=0.8, box=0.4))


def scores_of(boxes):
    return BoxScores(boxes, None, SENSOR)


def standing(points, distance_m, length_m, width_m, height_m):
    """One proposal on the ground ahead of a sensor at 1.73 m."""
    _, proposals = blobs([points])
    foot_m = 0.3
    box = np.array([[distance_m, 0.0, foot_m + height_m / 2 - 1.73, length_m, width_m, height_m, 0.0]])
    return dataclasses.replace(proposals, box=box)


def test_box_prior_excludes_proposals_below_the_threshold():
    probability = np.array([[0.995, 0.005, 0.0, 0.0], [0.97, 0.01, 0.01, 0.01], [0.1, 0.9, 0.0, 0.0]])
    prior = make_prior(scores_of(BOXES), FREQUENCY)
    assert prior.may_be_object(probability, 0.02).tolist() == [False, True, True]
    assert prior.pool_weight(Proposals.empty()) == 0.4
    assert prior.probability(Proposals.empty()).shape == (0, 4)


def test_prior_is_the_class_frequency_without_a_box_classifier():
    _, proposals = blobs([10, 20])
    prior = make_prior(scores_of(None), FREQUENCY)
    assert isinstance(prior, FrequencyPrior)
    assert_allclose(prior.probability(proposals), [FREQUENCY] * 2)
    assert prior.may_be_object(prior.probability(proposals), 1.0).all()
    assert prior.pool_weight(proposals) == 0.0
    assert prior.probability(Proposals.empty()).shape == (0, 4)


def test_scores_are_of_the_frame_that_is_given():
    """The scores of the last frame are kept."""
    scores = scores_of(BOXES)
    first, second = (blobs(counts, RNG)[1] for counts in ([10, 30], [20, 5, 7]))
    for proposals in (first, first, second, first):
        found = scores.of(proposals)
        expected = BOXES.log_probability(proposal_features(proposals, SENSOR), proposals.cut)
        assert_array_equal(found.box, expected)
        assert not found.reflectance.any()


@pytest.mark.parametrize("name", ["pointnet-kitti", "pointnet-synthetic"])
def test_box_priors_of_the_shipped_models(name):
    prior = make_prior(classifier(name).box_scores, FREQUENCY)
    car = prior.probability(standing(300, 12.0, 4.0, 1.6, 1.3))[0]
    person = prior.probability(standing(120, 12.0, 0.6, 0.5, 1.4))[0]
    wall = prior.probability(standing(600, 15.0, 12.0, 0.5, 2.3))[0]
    speck = prior.probability(standing(5, 15.0, 0.1, 0.1, 0.3))[0]
    assert car.argmax() == ObjectClass.CAR
    assert person[ObjectClass.PEDESTRIAN] > 0.1
    assert max(1 - wall[0], 1 - speck[0]) < 0.02
