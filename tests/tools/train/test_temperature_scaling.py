"""Calibration of class probabilities."""

from __future__ import annotations

import numpy as np
import pytest

from modt_desk.evaluation.class_score import top_calibration_error
from tools.train.held_out import Calibration, fit_calibration


def test_calibration_recovers_temperature_and_class_offsets() -> None:
    rng = np.random.default_rng(0)
    true = rng.normal([2.0, 0, 0, 0], 2.0, (6000, 4))
    share = Calibration.identity().apply(true)
    label = np.array([rng.choice(4, p=p) for p in share])
    distorted = 3 * (true - [2.0, 0, 0, 0])
    found = fit_calibration(distorted, label, np.full(6000, 1 / 6000))
    assert found.temperature == pytest.approx(3.0, rel=0.1)
    assert found.offset[1:] == pytest.approx(np.full(3, -2.0), abs=0.2)
    assert top_calibration_error(found.apply(distorted), label) < 0.02
    assert top_calibration_error(Calibration.identity().apply(distorted), label) > 0.1


def test_calibration_folds_into_the_last_layer() -> None:
    rng = np.random.default_rng(0)
    calibration = Calibration(1.7, np.array([0.0, -1.0, 0.5, 2.0]))
    x, weight, bias = rng.normal(size=(5, 8)), rng.normal(size=(8, 4)), rng.normal(size=4)
    *hidden, folded = calibration.fold_into([(weight, bias), (weight, bias)])
    np.testing.assert_allclose(hidden[0][0], weight, atol=1e-6)
    np.testing.assert_allclose(
        Calibration.identity().apply(x @ folded[0] + folded[1]), calibration.apply(x @ weight + bias), atol=1e-5
    )
