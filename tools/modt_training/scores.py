"""Scores of out-of-fold predictions, sensor by sensor.

The frequency of the classes differs by sensor and scene: log loss, calibration error and temperature are those of the
posterior under the class frequency of the sensor's crops.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.special import log_softmax, softmax

from modt.classes import CLASS_NAMES, N_CLASSES
from modt.types import NONE, Bool, Float64, Int
from modt_evaluation.class_score import (
    average_precision,
    precision_recall,
    top_calibration_error,
)
from modt_training.held_out import Validation, fit_calibration

MIN_OBJECT_POINTS = 20
"""Least number of points of the objects that count for recall at a precision."""
PRECISIONS = (0.9, 0.8)


def by_sensor(log_probability: Float64, valid: Validation, rows: Bool) -> dict[str, dict[str, Any]]:
    """Scores of log posteriors (R, C) by sensor. A mask (R,) selects the sensors, of which all crops are scored."""
    return {
        valid.sensor_names[s]: sensor_scores(log_probability, valid, valid.sensor == s)
        for s in np.unique(valid.sensor[rows]).tolist()
    }


def sensor_scores(log_probability: Float64, valid: Validation, of_sensor: Bool) -> dict[str, Any]:
    """Scores of the crops of a mask (R,).

    Keys: `average_precision` over all objects; `log_loss`; `temperature`, by which the logits of this sensor are
    still to be divided; `calibration_error` of the likeliest class; `recall`, by precision and class, of the objects
    of MIN_OBJECT_POINTS points, detected with the right class: as a share `of_all`, and `of_found`, those with a
    proposal of their own.
    """
    score = log_softmax(log_probability, axis=1)
    clear = of_sensor & valid.clear
    label = valid.label[clear]
    adapted = score[clear] + shift(np.bincount(label, minlength=N_CLASSES) / len(label), valid.class_frequency)
    error = top_calibration_error(softmax(adapted, axis=1), label)
    truth = valid.truth
    objects = np.isin(truth.sensor, np.unique(valid.sensor[of_sensor]))
    number = np.bincount(truth.label[objects] if objects.any() else label, minlength=N_CLASSES)
    rows = np.flatnonzero(of_sensor)
    probability = np.exp(score[rows])
    recall: dict[str, dict[str, Any]] = {str(precision): {} for precision in PRECISIONS}
    for c, name in enumerate(CLASS_NAMES[1:], 1):
        wanted = objects & (truth.label == c) & (truth.points >= MIN_OBJECT_POINTS)
        if wanted.any():
            for precision in PRECISIONS:
                found = recall_at(precision, score[:, c], valid.majority == c, of_sensor, wanted, truth.row)
                recall[str(precision)][name] = found
    return {
        "average_precision": average_precision(probability, valid.label[rows], number),
        "log_loss": round(-float(log_softmax(adapted, axis=1)[np.arange(len(label)), label].mean()), 4),
        "temperature": round(fit_calibration(adapted, label, np.full(len(label), 1 / len(label))).temperature, 2),
        "calibration_error": None if error is None else round(error, 4),
        "recall": recall,
    }


def shift(frequency: Float64, assumed: Float64) -> Float64:
    """(C,) to add to logits that assume a class frequency, for another one; absent classes stay."""
    return np.log(np.where(frequency > 0, frequency, assumed).clip(1e-9) / assumed.clip(1e-9))


def recall_at(
    precision: float, score: Float64, right: Bool, considered: Bool, wanted: Bool, row: Int
) -> dict[str, float | int]:
    """Recall of a class at the least score whose proposals have a precision.

    Args:
        precision: to be reached.
        score: (R,) score of the class.
        right: (R,) crops that lie on an object of the class.
        considered: (R,) crops to look at.
        wanted: (T,) objects to find.
        row: (T,) crop that is the whole object, NONE where it has none.
    """
    threshold, reached, _ = precision_recall(score[considered], right[considered], 1)
    enough = np.flatnonzero(reached >= precision)
    least = threshold[enough[-1]] if len(enough) else np.inf
    found = wanted & (row != NONE)
    called = int((score[row[found]] >= least).sum())
    n = int(wanted.sum())
    with_own = int(found.sum())
    return {"objects": n, "of_all": round(called / n, 4), "of_found": round(called / max(with_own, 1), 4)}
