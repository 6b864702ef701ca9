"""Measurement of the classifier's cost."""

from __future__ import annotations

from collections.abc import Callable

from modt.classification.pointnet import PointNet
from modt.classification.scheduler import LinearCost
from modt.types import Float32, Float64, Int, Proposals


class TimedClassifier:
    """Classifier that reports the CPU time of every call to the cost model.

    Args:
        classifier: that is timed.
        cost: model to update.
        cpu_ns: CPU time of the calling thread [ns].
    """

    def __init__(self, classifier: PointNet, cost: LinearCost, cpu_ns: Callable[[], int]) -> None:
        self._classifier, self._cost, self._cpu_ns = classifier, cost, cpu_ns
        self.facts = classifier.facts

    def classify(self, points: Float32, proposals: Proposals, which: Int) -> Float64:
        """(R, 4) class probabilities of the given proposals, in their order."""
        start_ns = self._cpu_ns()
        likelihood = self._classifier.classify(points, proposals, which)
        self._cost.update(proposals.count[which], (self._cpu_ns() - start_ns) / 1e6)
        return likelihood
