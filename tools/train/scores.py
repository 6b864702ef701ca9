"""How well proposals are classified."""

from __future__ import annotations

import numpy as np

from modt.classes import CLASS_NAMES, N_CLASSES
from modt.types import Float64, Int


def average_precision(probability: Float64, label: Int, truth: Int) -> dict[str, float]:
    """Area under the precision-recall curve of each class; an object without a proposal is a false negative.

    Args:
        probability: (R, 4) of proposals.
        label: (R,) their classes.
        truth: (4,) objects of each class that are there to be found.
    """
    out = {}
    for c in range(1, N_CLASSES):
        hit = (label == c)[np.argsort(-probability[:, c], kind="stable")]
        true = np.cumsum(hit)
        precision = np.maximum.accumulate((true / np.arange(1, len(true) + 1))[::-1])[::-1]
        out[CLASS_NAMES[c]] = round(float(precision[hit].sum() / max(truth[c], 1)), 4)
    return out


def confusion(probability: Float64, label: Int) -> list[list[int]]:
    """[true][called] number of proposals."""
    table = np.zeros((N_CLASSES, N_CLASSES), np.int64)
    np.add.at(table, (label, probability.argmax(axis=1)), 1)
    return [[int(n) for n in row] for row in table]
