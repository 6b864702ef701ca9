"""Scores of boxes and reflectance."""

from __future__ import annotations

import numpy as np
import pytest

from modt.classification import prior
from modt.classification.box_classifier import N_FEATURES, MlpBoxClassifier, proposal_features
from modt.classification.prior import BoxScores
from modt.classification.reflectance_classifier import NoReflectanceClassifier
from modt.config import SensorConfig
from modt.types import Float64, Proposals
from tests.classification.scenes import blobs

SENSOR = SensorConfig()


def test_scores_of_a_frame_are_worked_out_once(monkeypatch: pytest.MonkeyPatch) -> None:
    rng, calls = np.random.default_rng(2), []

    def counted(proposals: Proposals, sensor: SensorConfig) -> Float64:
        calls.append(len(proposals))
        return proposal_features(proposals, sensor)

    monkeypatch.setattr(prior, "proposal_features", counted)
    boxes = MlpBoxClassifier([(rng.normal(size=(N_FEATURES, 4)), rng.normal(size=4))], 0.4)
    scores = BoxScores(boxes, NoReflectanceClassifier(), SENSOR)
    _, first = blobs([10, 30], rng)
    _, second = blobs([20, 5, 7], rng)
    for proposals in (first, first, second, first):
        log_box, log_reflectance = scores.of(proposals)
        np.testing.assert_array_equal(log_box, boxes.log_probability(proposal_features(proposals, SENSOR)))
        assert not log_reflectance.any()
    assert calls == [2, 3, 2]
