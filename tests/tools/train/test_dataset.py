"""Data sets of crops."""

from __future__ import annotations

import numpy as np

from modt.classification.crops import Crops
from modt.types import NONE
from tests.tools.train.datasets import data_of, truth_of
from tools.train.dataset import SHIPPED, SYNTHETIC, folds


def test_folds_split_real_scans_by_drive_and_leave_out_the_rest() -> None:
    drive = np.array([0, 0, 1, 2, 3, 4, 4, 5])  # the last two drives are synthetic
    variant = np.where(drive < 4, SHIPPED, SYNTHETIC)
    label = np.array([1, 0, 2, 1, 0, 1, 0, 3])
    crops = Crops(np.zeros((len(drive), 3), np.float32), np.arange(len(drive) + 1))
    truth = truth_of(np.array([1, 2, 1]), np.array([0, 1, 2]))
    data = data_of(crops, label, variant=variant, drive=drive, truth=truth)
    fold = folds(data, 3)
    assert (fold[4:] == NONE).all()
    assert sorted(set(fold[:4].tolist())) == [0, 1, 2]
    assert len(set(fold[:3].tolist())) == 3  # the objects are spread


def test_unknown_and_partial_crops_are_not_trainable() -> None:
    partial, unknown = np.array([False, False, False, True]), np.array([True, False, True, False])
    crops = Crops(np.zeros((4, 3), np.float32), np.arange(5))
    data = data_of(crops, np.array([0, 0, 1, 0]), partial=partial, unknown=unknown)
    assert data.trainable.tolist() == [False, True, True, False]
