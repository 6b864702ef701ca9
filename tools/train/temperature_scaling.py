"""Calibration of class probabilities: a temperature and an offset for each class, fitted on held-out logits."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.optimize import minimize
from scipy.special import log_softmax, softmax

from modt.classes import N_CLASSES
from modt.classification.box_classifier import Layers, Weights
from modt.types import Float64, Int


@dataclass(frozen=True)
class Calibration:
    """probability = softmax(base + logits / temperature + offset); base is usually 0."""

    temperature: float
    offset: Float64

    @classmethod
    def identity(cls) -> Calibration:
        """Calibration without effect."""
        return cls(1.0, np.zeros(N_CLASSES))

    def apply(self, logits: Float64, base: Float64 | float = 0.0) -> Float64:
        """(R, 4) probabilities of logits (R, 4), added to calibrated logits `base`."""
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
        logits: (R, 4) uncalibrated.
        label: (R,) classes.
        weight: (R,) of each, 1 in total.
        base: (R, 4) calibrated logits that they are added to.
    """

    def loss(theta: Float64) -> float:
        z = log_softmax(base + logits * np.exp(-theta[0]) + np.append(0.0, theta[1:]), axis=1)
        prior = 0.05 * float(np.sum(theta**2)) / np.count_nonzero(weight)
        return prior - float(weight @ z[np.arange(len(label)), label])

    found = minimize(loss, np.zeros(N_CLASSES), method="L-BFGS-B")
    return Calibration(float(np.exp(found.x[0])), np.append(0.0, found.x[1:]))
