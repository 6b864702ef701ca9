"""Weights of the pool."""

from __future__ import annotations

import numpy as np
from scipy.special import softmax

from modt.classification.crops import Crops
from tests.tools.train.datasets import data_of, truth_of
from tools.train.held_out import Validation, fit_pool

LABEL = np.arange(400) % 4
SURE = np.log(np.eye(4)[LABEL] * 0.96 + 0.01)
NOTHING = np.zeros((400, 4))


def validation() -> Validation:
    """400 crops, of every class as many."""
    crops = Crops(np.zeros((400, 3), np.float32), np.arange(401))
    return Validation.of(data_of(crops, LABEL, truth=truth_of(LABEL, 0 * LABEL, row=np.arange(400))))


def test_what_contradicts_a_network_that_is_right_has_no_weight() -> None:
    valid = validation()
    weights, _ = fit_pool(softmax(SURE, axis=1), softmax(-SURE, axis=1), -SURE, valid, valid.weight)
    assert weights.network > 0.95
    assert max(weights.box, weights.reflectance) < 0.05


def test_the_box_tells_objects_from_background_alone() -> None:
    valid = validation()
    weights, log_posterior = fit_pool(softmax(NOTHING, axis=1), softmax(SURE, axis=1), NOTHING, valid, valid.weight)
    assert weights.box > 0.95
    assert weights.reflectance == 0.0
    posterior = softmax(log_posterior, axis=1)
    assert posterior[LABEL == 0, 0].min() > 0.9
    np.testing.assert_allclose(posterior[:, 1], posterior[:, 3])
