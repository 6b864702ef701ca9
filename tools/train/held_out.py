"""Out-of-fold predictions: each validation crop by a model trained without its drive."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from modt.classes import N_CLASSES
from modt.types import Bool, Float64, Int
from tools.train.dataset import Dataset, folds
from tools.train.temperature_scaling import Calibration, fit_calibration

Model = Callable[[Int], Float64]
"""Maps rows (R,) to logits (R, 4)."""


@dataclass(frozen=True)
class HeldOut:
    """Predictions for the validation crops: those of real scans where the data set has any.

    Attributes:
        logits: (R, 4) of each crop.
        label: (R,) its class.
        unambiguous: (R,) clearly one object, or clearly none.
        truth: (4,) labelled objects of each class, those missed by the segmentation included.
        calibration: fitted to the unambiguous crops.
    """

    logits: Float64
    label: Int
    unambiguous: Bool
    truth: Int
    calibration: Calibration

    @property
    def probability(self) -> Float64:
        """(R, 4) calibrated."""
        return self.calibration.apply(self.logits)


def out_of_fold(data: Dataset, k: int, train: Callable[[Bool, int], Model]) -> HeldOut:
    """Cross-validate over drives.

    Args:
        data: all crops.
        k: number of folds.
        train: returns a model trained on a mask (R,) of rows, for each fold.
    """
    fold = folds(data, k)
    rows = np.flatnonzero((data.variant == data.variant.min()) & ~data.unknown)
    out = np.zeros((len(rows), N_CLASSES))
    for i in range(k):
        model = train(fold[data.drive] != i, i)
        mine = np.flatnonzero(fold[data.drive[rows]] == i)
        out[mine] = model(rows[mine])
    label, clear = data.label[rows], ~data.partial[rows]
    present = np.isin(data.truth_drive, data.drive[rows])
    truth = np.bincount(data.truth_label[present] if present.any() else label, minlength=N_CLASSES)
    return HeldOut(out, label, clear, truth, fit_calibration(out[clear], label[clear]))
