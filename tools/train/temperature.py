"""Confidences that mean what they say: a temperature and an offset a class, fitted on held-out logits."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.optimize import minimize
from scipy.special import log_softmax, softmax

from modt.classes import N_CLASSES
from modt.types import Float32, Float64, Int


@dataclass(frozen=True)
class Calibration:
    """probability = softmax(base + logits / temperature + offset), mostly without a base."""

    temperature: float
    offset: Float64

    @classmethod
    def none(cls) -> Calibration:
        """Leaves everything as it is."""
        return cls(1.0, np.zeros(N_CLASSES))

    def apply(self, logits: Float64, base: Float64 | float = 0.0) -> Float64:
        """(R, 4) probabilities of logits, added to others that are calibrated."""
        probability: Float64 = softmax(base + logits / self.temperature + self.offset, axis=1)
        return probability

    def folded(self, last: tuple[Float32, Float32]) -> tuple[Float32, Float32]:
        """The last layer with this in it."""
        weight, bias = last
        return (
            (weight / self.temperature).astype(np.float32),
            (bias / self.temperature + self.offset).astype(np.float32),
        )

    @classmethod
    def of_dict(cls, report: dict[str, Any]) -> Calibration:
        """From a report."""
        return cls(float(report["temperature"]), np.array(report["offset"]))

    def as_dict(self) -> dict[str, Any]:
        """For a report."""
        return {"temperature": round(self.temperature, 4), "offset": [round(float(v), 4) for v in self.offset]}


def fit(logits: Float64, label: Int, base: Float64 | float = 0.0) -> Calibration:
    """Maximum likelihood on held-out logits; the offsets carry how common each class is among proposals.

    Args:
        logits: (R, 4) to be calibrated.
        label: (R,) classes.
        base: (R, 4) what they are added to.
    """

    def loss(theta: Float64) -> float:
        z = log_softmax(base + logits * np.exp(-theta[0]) + np.append(0.0, theta[1:]), axis=1)
        prior = 0.05 * float(np.sum(theta**2)) / len(label)
        return prior - float(z[np.arange(len(label)), label].mean())

    found = minimize(loss, np.zeros(N_CLASSES), method="L-BFGS-B")
    return Calibration(float(np.exp(found.x[0])), np.append(0.0, found.x[1:]))
