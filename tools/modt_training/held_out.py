"""Out-of-fold predictions, each validation crop by a model trained without its drive; calibration and pool."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.optimize import minimize
from scipy.special import log_softmax, softmax

from modt.classes import N_CLASSES
from modt.classification.box_classifier import Layers, Weights
from modt.classification.pool import PoolWeights, log_pool
from modt.types import NONE, Bool, Float64, Int
from modt_training.dataset import Dataset, LabelledObjects, folds

LogitsOfRows = Callable[[Int], Float64]
"""Maps rows (R,) to logits (R, C)."""


@dataclass(frozen=True)
class Calibration:
    """probability = softmax(base + logits / temperature + offset); base is usually 0."""

    temperature: float
    offset: Float64

    def apply(self, logits: Float64, base: Float64 | float = 0.0) -> Float64:
        """(R, C) probabilities of logits (R, C), added to calibrated logits `base`."""
        probability: Float64 = softmax(base + logits / self.temperature + self.offset, axis=1)
        return probability

    def fold_into(self, layers: Layers) -> list[tuple[Weights, Weights]]:
        """Layers with the calibration folded into the last one, float32."""
        *hidden, (weight, bias) = layers
        last = weight / self.temperature, bias / self.temperature + self.offset
        return [(w.astype(np.float32), b.astype(np.float32)) for w, b in (*hidden, last)]

    def as_dict(self) -> dict[str, Any]:
        """Entries of a report, rounded."""
        return {"temperature": round(self.temperature, 4), "offset": [round(float(v), 4) for v in self.offset]}


def fit_calibration(logits: Float64, label: Int, weight: Float64, base: Float64 | float = 0.0) -> Calibration:
    """Maximum-likelihood calibration on held-out logits; the offsets absorb the weighted class frequencies.

    Args:
        logits: (R, C) uncalibrated.
        label: (R,) classes.
        weight: (R,) weight of each, 1 in total.
        base: (R, C) calibrated logits that they are added to.
    """

    def loss(theta: Float64) -> float:
        z = log_softmax(base + logits * np.exp(-theta[0]) + np.append(0.0, theta[1:]), axis=1)
        prior = 0.05 * float(np.sum(theta**2)) / np.count_nonzero(weight)
        return prior - float(weight @ z[np.arange(len(label)), label])

    found = minimize(loss, np.zeros(N_CLASSES), method="L-BFGS-B")
    return Calibration(float(np.exp(found.x[0])), np.append(0.0, found.x[1:]))


@dataclass(frozen=True)
class Validation:
    """The crops that are validated: those of real scans, where the data set has any.

    Attributes:
        rows: (R,) rows of the data set.
        label, majority: (R,) class, and class whose objects hold most of the points.
        clear: (R,) clearly one object, or clearly none.
        sensor: (R,) as in the data set.
        sensor_names: names of the sensors of the data set.
        truth: labelled objects of the drives of these crops; their rows are among the R.
    """

    rows: Int
    label: Int
    majority: Int
    clear: Bool
    sensor: Int
    sensor_names: tuple[str, ...]
    truth: LabelledObjects

    @classmethod
    def of(cls, data: Dataset) -> Validation:
        """Validation part of a data set."""
        rows = np.flatnonzero(data.validated & ~data.unknown)
        place = np.full(len(data) + 1, NONE)  # index -1, NONE, is the last one
        place[rows] = np.arange(len(rows))
        truth = data.truth.take(np.isin(data.truth.drive, data.drive[rows]))
        return cls(
            rows,
            data.label[rows],
            data.majority[rows],
            ~data.partial[rows],
            data.sensor[rows],
            data.sensor_names,
            replace(truth, row=place[truth.row]),
        )

    @property
    def weight(self) -> Float64:
        """(R,) weight of each clear crop, the same in total for every sensor."""
        number = np.bincount(self.sensor[self.clear], minlength=len(self.sensor_names))
        weight: Float64 = self.clear / number[self.sensor].clip(1)
        return weight / weight.sum()

    @property
    def class_frequency(self) -> Float64:
        """(C,) frequency of the classes among the weighted crops, which a posterior calibrated to them assumes."""
        return np.asarray(np.bincount(self.label, self.weight, N_CLASSES), np.float64)

    def weight_of(self, mask: Bool) -> Float64:
        """(R,) weight of the clear crops of a mask (R,), with the class frequency of all crops."""
        weight = self.weight * mask
        frequency = np.bincount(self.label, weight, N_CLASSES)
        weight *= (self.class_frequency / np.where(frequency > 0, frequency, 1.0))[self.label]
        return weight / weight.sum()


@dataclass(frozen=True)
class HeldOut:
    """Predictions for the validation crops.

    Attributes:
        validation: the crops.
        logits: (R, C) logits of each.
        calibration: fitted to the clear ones.
    """

    validation: Validation
    logits: Float64
    calibration: Calibration

    @property
    def probability(self) -> Float64:
        """(R, C) calibrated probabilities."""
        return self.calibration.apply(self.logits)


def out_of_fold(data: Dataset, k: int, train: Callable[[Bool, int], LogitsOfRows]) -> HeldOut:
    """Cross-validate over drives.

    Args:
        data: all crops.
        k: number of folds.
        train: returns a model trained on a mask (R,) of rows, for each fold.
    """
    fold = folds(data, k)
    valid = Validation.of(data)
    out = np.zeros((len(valid.rows), N_CLASSES))
    for i in range(k):
        model = train(fold[data.drive] != i, i)
        in_fold = np.flatnonzero(fold[data.drive[valid.rows]] == i)
        out[in_fold] = model(valid.rows[in_fold])
    return HeldOut(valid, out, fit_calibration(out, valid.label, valid.weight))


def fit_pool(
    network: Float64, box: Float64, reflectance: Float64, valid: Validation, weight: Float64
) -> tuple[PoolWeights, Float64]:
    """Weights of modt.classification.pool that minimise the log loss; (R, C) log posteriors of the pool.

    The weights are 0 to 1, rounded to 0.01.

    Args:
        network: (R, C) P(class | points).
        box: (R, C) P(class | box).
        reflectance: (R, C) log P(reflectance | class, box), zeros without: its weight is then zero.
        valid: the crops.
        weight: (R,) weight of each, 1 in total.
    """
    log_frequency = np.log(valid.class_frequency.clip(1e-9))

    def log_posterior(weights: PoolWeights) -> Float64:
        out: Float64 = log_softmax(log_pool(network, np.log(box), reflectance, log_frequency, weights), axis=1)
        return out

    def loss(x: Float64) -> float:
        return -float(weight @ log_posterior(PoolWeights(*x.tolist()))[np.arange(len(valid.label)), valid.label])

    known = bool(reflectance.any())
    found = minimize(loss, x0=(0.8, 0.4, 0.5 * known), bounds=((0.0, 1.0), (0.0, 1.0), (0.0, float(known))))
    weights = PoolWeights(*(round(w, 2) for w in found.x.tolist()))
    return weights, log_posterior(weights)
