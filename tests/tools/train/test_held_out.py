"""Cross-validation over drives."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from modt.classification.crops import Crops
from tests.tools.train.datasets import data_of
from tools.train.held_out import out_of_fold


def test_out_of_fold_models_predict_drives_unseen_in_training() -> None:
    drive = np.repeat(np.arange(6), 5)
    label = np.tile(np.arange(5) % 4, 6)
    crops = Crops(np.zeros((30, 3), np.float32), np.arange(31))
    data = data_of(crops, label, drive=drive, truth_label=label, truth_drive=drive)
    predicted = []

    def trained(among: np.ndarray, i: int) -> Callable[[np.ndarray], np.ndarray]:
        def model(rows: np.ndarray) -> np.ndarray:
            assert not np.isin(drive[rows], drive[among]).any()
            predicted.extend(rows.tolist())
            return np.eye(4)[label[rows]] * (i + 1)

        return model

    held = out_of_fold(data, 3, trained)
    assert sorted(predicted) == list(range(30))
    assert (held.logits.argmax(axis=1) == held.label).all()
    assert held.truth.tolist() == np.bincount(label).tolist()
