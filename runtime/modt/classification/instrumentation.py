"""Measurement of the classifier's cost."""

from __future__ import annotations

from collections.abc import Callable
from itertools import product
from typing import Protocol

import numpy as np

from modt.classification.scheduler import LinearCost
from modt.types import Float32, Float64, Int, Proposals

_ROUNDS = 5
_FEW_POINTS = 8
_CACHE_BYTES = 4 << 20
"""Written before each call of the warm-up: between two frames other stages fill the caches."""


class Classifier(Protocol):
    """Points to class likelihoods."""

    def classify(self, points: Float32, proposals: Proposals, which: Int) -> Float64:
        """(R, 4) class probabilities of the given proposals, in their order."""

    def facts(self) -> dict[str, str]:
        """Which model it is."""


class TimedClassifier:
    """Classifier that reports the CPU time of every call to the cost model.

    Args:
        classifier: that is timed.
        cost: model to update.
        cpu_ns: CPU time of the calling thread [ns].
    """

    def __init__(self, classifier: Classifier, cost: LinearCost, cpu_ns: Callable[[], int]) -> None:
        self._classifier, self._cost, self._cpu_ns = classifier, cost, cpu_ns
        self.facts = classifier.facts

    def classify(self, points: Float32, proposals: Proposals, which: Int) -> Float64:
        """(R, 4) class probabilities of the given proposals, in their order."""
        start_ns = self._cpu_ns()
        likelihood = self._classifier.classify(points, proposals, which)
        self._cost.update(proposals.count[which], (self._cpu_ns() - start_ns) / 1e6)
        return likelihood


def warm_up(classifier: Classifier, cost: LinearCost, max_points: int, batch: int, cpu_ns: Callable[[], int]) -> None:
    """Classify small and large frames, so that no frame pays for what a first call sets up; the cost model learns."""
    for n, points in product((1, batch, 2 * batch), (min(_FEW_POINTS, max_points), max_points)):
        cloud, proposals = _columns(n, points)
        times_ms = []
        for _ in range(_ROUNDS):
            np.ones(_CACHE_BYTES, np.uint8)
            start_ns = cpu_ns()
            classifier.classify(cloud, proposals, np.arange(n))
            times_ms.append((cpu_ns() - start_ns) / 1e6)
        cost.warmed_up(proposals.count, float(np.median(times_ms)))


def _columns(n: int, points: int) -> tuple[Float32, Proposals]:
    """A frame of n columns of so many points, a metre high and ten away, and its proposals."""
    xyz = np.zeros((n * points, 3), np.float32)
    xyz[:, 0], xyz[:, 2] = 10.0, np.tile(np.linspace(-1.0, 0.0, points), n)
    box = np.tile([10.0, 0.0, -0.5, 0.1, 0.1, 1.0, 0.0], (n, 1))
    return np.pad(xyz, ((0, 0), (0, 1))), Proposals(
        members=np.arange(len(xyz)),
        offsets=points * np.arange(n + 1),
        coordinates=xyz.T.copy(),
        centroid=box[:, :3],
        box=box,
        truncated=np.zeros(n, np.bool_),
        reflectance=np.zeros((n, 5)),
    )
