"""Cross-validation over drives."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from modt.classification.crops import Crops
from modt.types import NONE
from tests.tools.train.datasets import data_of, truth_of
from tools.train.dataset import CLUSTERED, SHIPPED
from tools.train.held_out import Validation, out_of_fold


def test_out_of_fold_models_predict_drives_unseen_in_training() -> None:
    drive = np.repeat(np.arange(6), 5)
    label = np.tile(np.arange(5) % 4, 6)
    crops = Crops(np.zeros((30, 3), np.float32), np.arange(31))
    data = data_of(crops, label, drive=drive, truth=truth_of(label, drive))
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


def test_every_sensor_counts_as_much_as_the_others() -> None:
    label, sensor = np.array([0, 0, 0, 1, 0, 1, 2, 0]), np.array([0, 0, 0, 0, 1, 1, 1, 1])
    partial, variant = np.arange(8) == 4, np.where(np.arange(8) == 7, CLUSTERED, SHIPPED)
    crops = Crops(np.zeros((8, 3), np.float32), np.arange(9))
    truth = truth_of(label[4:], np.array([0, 0, 0, 9]), row=np.array([5, NONE, 7, 4]))
    columns = {"sensor": sensor, "sensor_names": ("a", "b"), "partial": partial, "variant": variant}
    valid = Validation.of(data_of(crops, label, truth=truth, **columns))
    np.testing.assert_allclose(valid.weight, [1 / 8] * 4 + [0, 1 / 4, 1 / 4])
    np.testing.assert_allclose(valid.class_frequency, [3 / 8, 3 / 8, 1 / 4, 0])
    assert valid.truth.row.tolist() == [5, NONE, NONE]  # crop 7 and drive 9 are not validated
    some = valid.weight_of(valid.sensor == 1)
    assert not some[:5].any()
    np.testing.assert_allclose(np.bincount(valid.label, some)[1:] * 5 / 8, [3 / 8, 1 / 4])  # as often as among all
