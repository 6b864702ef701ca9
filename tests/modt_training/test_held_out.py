"""Cross-validation over drives: folds, weights of the pool, calibration, scores by sensor."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.special import softmax

from modt.classification.crops import Crops
from modt.types import NONE, Int
from modt_evaluation.class_score import top_calibration_error
from modt_training.dataset import CLUSTERED, REAL, SYNTHETIC, Dataset, folds
from modt_training.held_out import Calibration, Validation, fit_calibration, fit_pool, out_of_fold
from modt_training.scores import by_sensor, recall_at, shift
from tests.tools.train.datasets import data_of, truth_of

IDENTITY = Calibration(1.0, np.zeros(4))


def single_points(label: Int, **columns: Any) -> Dataset:
    """Crops of one point each."""
    return data_of(Crops(np.zeros((len(label), 3), np.float32), np.arange(len(label) + 1)), label, **columns)


def test_folds_split_real_scans_by_drive_and_leave_out_the_rest():
    drive = np.array([0, 0, 1, 2, 3, 4, 4, 5])  # the last two drives are synthetic
    truth = truth_of(np.array([1, 2, 1]), np.array([0, 1, 2]))
    label = np.array([1, 0, 2, 1, 0, 1, 0, 3])
    variant = np.where(drive < 4, REAL, SYNTHETIC)
    fold = folds(single_points(label, variant=variant, drive=drive, truth=truth), 3)
    assert (fold[4:] == NONE).all()
    assert sorted(set(fold[:4].tolist())) == [0, 1, 2]
    assert len(set(fold[:3].tolist())) == 3  # the objects are spread


def test_out_of_fold_models_predict_drives_unseen_in_training():
    drive = np.repeat(np.arange(6), 5)
    label = np.tile(np.arange(5) % 4, 6)
    data = single_points(label, drive=drive, truth=truth_of(label, drive))
    predicted = []

    def trained(among: np.ndarray, i: int) -> Callable[[np.ndarray], np.ndarray]:
        def model(rows: np.ndarray) -> np.ndarray:
            assert not np.isin(drive[rows], drive[among]).any()
            predicted.extend(rows.tolist())
            return np.eye(4)[label[rows]] * (i + 1)

        return model

    held = out_of_fold(data, 3, trained)
    assert sorted(predicted) == list(range(30))
    assert (held.logits.argmax(axis=1) == held.validation.label).all()


def test_every_sensor_counts_as_much_as_the_others():
    label = np.array([0, 0, 0, 1, 0, 1, 2, 0])
    sensor = np.array([0, 0, 0, 0, 1, 1, 1, 1])
    partial = np.arange(8) == 4
    variant = np.where(np.arange(8) == 7, CLUSTERED, REAL)
    truth = truth_of(label[4:], np.array([0, 0, 0, 9]), row=np.array([5, NONE, 7, 4]))
    columns = {"sensor": sensor, "sensor_names": ("a", "b"), "partial": partial, "variant": variant}
    valid = Validation.of(single_points(label, truth=truth, **columns))
    assert_allclose(valid.weight, [1 / 8] * 4 + [0, 1 / 4, 1 / 4])
    assert_allclose(valid.class_frequency, [3 / 8, 3 / 8, 1 / 4, 0])
    assert valid.truth.row.tolist() == [5, NONE, NONE]  # crop 7 and drive 9 are not validated
    some = valid.weight_of(valid.sensor == 1)
    assert not some[:5].any()
    assert_allclose(np.bincount(valid.label, some)[1:] * 5 / 8, [3 / 8, 1 / 4])  # as often as among all


def test_the_box_tells_objects_from_background_alone():
    label = np.arange(400) % 4
    nothing = np.zeros((400, 4))
    valid = Validation.of(single_points(label, truth=truth_of(label, 0 * label, row=np.arange(400))))
    box = np.eye(4)[label] * 0.96 + 0.01
    weights, log_posterior = fit_pool(softmax(nothing, axis=1), box, nothing, valid, valid.weight)
    assert weights.box > 0.95
    assert weights.reflectance == 0.0
    posterior = softmax(log_posterior, axis=1)
    assert posterior[label == 0, 0].min() > 0.9
    assert_allclose(posterior[:, 1], posterior[:, 3])


def test_calibration_recovers_temperature_and_class_offsets(rng):
    true = rng.normal([2.0, 0, 0, 0], 2.0, (6000, 4))
    share = IDENTITY.apply(true)
    label = np.array([rng.choice(4, p=p) for p in share])
    distorted = 3 * (true - [2.0, 0, 0, 0])
    found = fit_calibration(distorted, label, np.full(6000, 1 / 6000))
    assert found.temperature == pytest.approx(3.0, rel=0.1)
    assert found.offset[1:] == pytest.approx(np.full(3, -2.0), abs=0.2)
    assert top_calibration_error(found.apply(distorted), label) < 0.02
    assert top_calibration_error(IDENTITY.apply(distorted), label) > 0.1


def test_calibration_folds_into_the_last_layer(rng):
    calibration = Calibration(1.7, np.array([0.0, -1.0, 0.5, 2.0]))
    x = rng.normal(size=(5, 8))
    weight = rng.normal(size=(8, 4))
    bias = rng.normal(size=4)
    *hidden, folded = calibration.fold_into([(weight, bias), (weight, bias)])
    assert_allclose(hidden[0][0], weight, atol=1e-6)
    assert_allclose(IDENTITY.apply(x @ folded[0] + folded[1]), calibration.apply(x @ weight + bias), atol=1e-5)


def test_recall_counts_the_objects_called_right_at_the_precision():
    score = np.array([9.0, 8, 7, 6, 5, 4])
    right = np.array([True, True, False, True, True, False])
    row = np.array([0, 3, 4, NONE, 5])
    every = np.ones(6, np.bool_)
    wanted = np.array([True, True, True, True, False])  # the last one has too few points

    def recall(precision: float) -> tuple[float, float]:
        found = recall_at(precision, score, right, every, wanted, row)
        assert found["objects"] == 4
        return found["of_all"], found["of_found"]

    assert recall(0.9) == (0.25, 0.3333)
    assert recall(0.8) == (0.75, 1.0)  # four right of five
    assert recall_at(0.8, score, ~right, every, wanted, row)["of_all"] == 0.0


def test_scores_are_of_the_posterior_under_the_class_frequency_of_the_sensor(rng):
    n = 4000
    frequency = np.array([[0.9, 0.05, 0.03, 0.02], [0.4, 0.2, 0.2, 0.2]])
    sensor = np.repeat([0, 1], n)
    label = np.concatenate([rng.choice(4, n, p=p) for p in frequency])
    likelihood = np.eye(4)[label] * 2.0 + rng.normal(0, 1.5, (2 * n, 4))
    truth = truth_of(label, sensor, sensor=sensor, row=np.arange(2 * n))
    columns = {"sensor": sensor, "drive": sensor, "sensor_names": ("rare", "often")}
    valid = Validation.of(single_points(label, truth=truth, **columns))
    scale = 2.0 / 1.5**2  # of the exact log-likelihood ratio
    exact = by_sensor(scale * likelihood + np.log(valid.class_frequency), valid, valid.clear)
    assert set(exact) == {"often", "rare"}
    for scores in exact.values():
        assert scores["temperature"] == pytest.approx(1.0, abs=0.1)
        assert scores["calibration_error"] < 0.03


def test_a_class_that_is_absent_keeps_the_assumed_frequency():
    assumed = np.array([0.7, 0.1, 0.1, 0.1])
    found = shift(np.array([0.5, 0.5, 0.0, 0.0]), assumed)
    assert_allclose(found, np.log([0.5 / 0.7, 5.0, 1.0, 1.0]))
