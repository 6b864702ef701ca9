"""Scores of boxes and reflectance."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from modt.classification.box_classifier import (
    N_BOUND_FEATURES,
    N_FEATURES,
    MlpBoxClassifier,
    bound_features,
    logits,
    proposal_features,
)
from modt.classification.prior import BoxScores
from modt.classification.reflectance_classifier import NoReflectanceClassifier
from modt.config import SensorConfig
from modt.types import Cut
from tests.classification.scenes import blobs

SENSOR = SensorConfig()


def test_scores_are_of_the_frame_that_is_given() -> None:
    rng = np.random.default_rng(2)
    boxes = MlpBoxClassifier([(rng.normal(size=(N_FEATURES, 4)), rng.normal(size=4))], 0.4)
    scores = BoxScores(boxes, NoReflectanceClassifier(), SENSOR)
    first, second = (blobs(counts, rng)[1] for counts in ([10, 30], [20, 5, 7]))
    for proposals in (first, first, second, first):
        log_box, log_reflectance = scores.of(proposals)
        expected = boxes.log_probability(proposal_features(proposals, SENSOR), proposals.cut)
        np.testing.assert_array_equal(log_box, expected)
        assert not log_reflectance.any()


def test_boxes_that_are_cut_where_a_person_may_go_on_are_scored_as_bounds() -> None:
    rng = np.random.default_rng(3)
    sizes, bounds = ([(rng.normal(size=(n, 4)), rng.normal(size=4))] for n in (N_FEATURES, N_BOUND_FEATURES))
    _, blob = blobs([10] * 6, rng)
    box = np.tile([2.0, 0.0, 0.0, 0.5, 0.5, 0.4, 0.0], (6, 1))
    box[3, 5] = 5.0  # higher than any person
    box[4, 2] = 0.6  # begins above the knees
    cut = np.array([0, Cut.TOP, Cut.TOP | Cut.NEAR, Cut.TOP, Cut.BOTTOM, Cut.BOTTOM])
    proposals = replace(blob, box=box, cut=cut, ground_z_m=np.full(6, -0.3))
    scored = BoxScores(MlpBoxClassifier(sizes, 0.4, bounds), NoReflectanceClassifier(), SENSOR).of(proposals)[0]
    features = proposal_features(proposals, SENSOR)
    by_size, by_bounds = logits(sizes, features), logits(bounds, bound_features(features, cut))
    is_bound = [False, True, True, False, True, False]
    np.testing.assert_allclose(scored, np.where(np.array(is_bound)[:, None], by_bounds, by_size))
    without = BoxScores(MlpBoxClassifier(sizes, 0.4), NoReflectanceClassifier(), SENSOR).of(proposals)[0]
    np.testing.assert_array_equal(without, by_size)
