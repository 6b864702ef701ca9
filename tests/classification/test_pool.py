"""The pool of network, box and reflectance."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.special import softmax

from modt.classification.pool import PoolWeights, log_pool, object_log_odds, pooled_prior

FREQUENCY = np.array([0.8, 0.1, 0.06, 0.04])
BOX = np.log([[0.8, 0.1, 0.06, 0.04], [1.0, 0.98, 0.01, 0.01], [0.5, 0.005, 0.005, 0.49], [0.9997, 1e-4, 1e-4, 1e-4]])
"""Log posteriors by the box, up to a constant a row."""


def test_the_box_says_whether_there_is_an_object_and_not_which() -> None:
    odds = object_log_odds(BOX, np.log(FREQUENCY))
    np.testing.assert_allclose(odds, np.log([1.0, 4.0, 4.0, 3e-4 / 0.9997 * 4.0]), atol=1e-12)
    np.testing.assert_allclose(softmax(pooled_prior(BOX[:2], np.log(FREQUENCY), 1.0), axis=1)[0], FREQUENCY)
    np.testing.assert_allclose(softmax(pooled_prior(BOX, np.log(FREQUENCY), 0.0), axis=1), np.tile(FREQUENCY, (4, 1)))


@pytest.mark.parametrize("weight", [0.0, 0.5, 1.0])
def test_evidence_multiplies_the_class_frequency_once(weight: float) -> None:
    none = np.zeros((4, 4))
    frequency = np.tile(FREQUENCY, (4, 1))
    weights = PoolWeights(weight, weight, weight)
    pool = softmax(log_pool(frequency, np.log(frequency), none, np.log(FREQUENCY), weights), axis=1)
    np.testing.assert_allclose(pool, frequency)
