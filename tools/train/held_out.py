"""What is said of crops by models that never saw their drives."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from modt.classes import N_CLASSES
from modt.types import Bool, Float64, Int
from tools.train.dataset import Dataset, folds
from tools.train.temperature import Calibration, fit

Model = Callable[[Int], Float64]
"""(R, 4) logits of rows."""


@dataclass(frozen=True)
class HeldOut:
    """What was said of the crops that are judged, those of real scans where there are any.

    Attributes:
        logits: (R, 4) of each.
        label: (R,) its class.
        clear: (R,) it is clearly one object, or clearly none.
        truth: (4,) objects of each class that are there to be found; those that segmentation missed are missed.
        calibration: fitted to the clear ones.
    """

    logits: Float64
    label: Int
    clear: Bool
    truth: Int
    calibration: Calibration

    @property
    def probability(self) -> Float64:
        """(R, 4) calibrated."""
        return self.calibration.apply(self.logits)


def cross_validated(data: Dataset, k: int, trained: Callable[[Bool, int], Model]) -> HeldOut:
    """Every judged crop by the model that never saw its drive.

    Args:
        data: all crops.
        k: folds.
        trained: makes a model of the rows among which it may learn, for each fold.
    """
    fold = folds(data, k)
    judged = np.flatnonzero((data.variant == data.variant.min()) & ~data.unknown)
    out = np.zeros((len(judged), N_CLASSES))
    for i in range(k):
        model = trained(fold[data.drive] != i, i)
        mine = np.flatnonzero(fold[data.drive[judged]] == i)
        out[mine] = model(judged[mine])
    label, clear = data.label[judged], ~data.partial[judged]
    there = np.isin(data.truth_drive, data.drive[judged])
    truth = np.bincount(data.truth_label[there] if there.any() else label, minlength=N_CLASSES)
    return HeldOut(out, label, clear, truth, fit(out[clear], label[clear]))
