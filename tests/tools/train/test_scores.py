"""Scores of out-of-fold predictions by sensor."""

from __future__ import annotations

import numpy as np
import pytest

from modt.classification.crops import Crops
from modt.types import NONE
from tests.tools.train.datasets import data_of, truth_of
from tools.train.held_out import Validation
from tools.train.scores import by_sensor, recall_at, shift


def test_recall_counts_the_objects_called_right_at_the_precision() -> None:
    score = np.array([9.0, 8, 7, 6, 5, 4])
    right = np.array([True, True, False, True, True, False])
    row, every = np.array([0, 3, 4, NONE, 5]), np.ones(6, np.bool_)
    wanted = np.array([True, True, True, True, False])  # the last one has too few points

    def recall(precision: float) -> tuple[float, float]:
        found = recall_at(precision, score, right, every, wanted, row)
        assert found["objects"] == 4
        return found["of_all"], found["of_found"]

    assert recall(0.9) == (0.25, 0.3333)
    assert recall(0.8) == (0.75, 1.0)  # four right of five
    assert recall_at(0.8, score, ~right, every, wanted, row)["of_all"] == 0.0


def test_scores_are_of_the_posterior_under_the_class_frequency_of_the_sensor() -> None:
    rng = np.random.default_rng(0)
    n = 4000
    frequency = np.array([[0.9, 0.05, 0.03, 0.02], [0.4, 0.2, 0.2, 0.2]])
    sensor = np.repeat([0, 1], n)
    label = np.concatenate([rng.choice(4, n, p=p) for p in frequency])
    likelihood = np.eye(4)[label] * 2.0 + rng.normal(0, 1.5, (2 * n, 4))
    crops = Crops(np.zeros((2 * n, 3), np.float32), np.arange(2 * n + 1))
    truth = truth_of(label, sensor, sensor=sensor, row=np.arange(2 * n))
    columns = {"sensor": sensor, "drive": sensor, "sensor_names": ("rare", "often")}
    valid = Validation.of(data_of(crops, label, truth=truth, **columns))
    scale = 2.0 / 1.5**2  # of the exact log-likelihood ratio
    exact = by_sensor(scale * likelihood + np.log(valid.class_frequency), valid, valid.clear)
    assert set(exact) == {"often", "rare"}
    for scores in exact.values():
        assert scores["temperature"] == pytest.approx(1.0, abs=0.1)
        assert scores["calibration_error"] < 0.03
    sharper = by_sensor(3 * scale * likelihood + np.log(valid.class_frequency), valid, valid.sensor == 0)
    assert list(sharper) == ["rare"]
    assert sharper["rare"]["temperature"] == pytest.approx(3.0, rel=0.15)
    assert sharper["rare"]["calibration_error"] > 0.05


def test_a_class_that_is_absent_keeps_the_assumed_frequency() -> None:
    assumed = np.array([0.7, 0.1, 0.1, 0.1])
    found = shift(np.array([0.5, 0.5, 0.0, 0.0]), assumed)
    np.testing.assert_allclose(found, np.log([0.5 / 0.7, 5.0, 1.0, 1.0]))
