"""A classifier that teaches the cost model what it costs on this machine."""

from __future__ import annotations

from collections.abc import Callable

from modt.classification.pointnet import PointNet
from modt.classification.scheduler import CostModel
from modt.types import Float32, Float64, Int, Proposals


class CostedClassifier:
    """Passes every call on and reports its CPU time to the cost model.

    Args:
        classifier: that does the work.
        cost: that learns.
        cpu_ns: CPU time of the calling thread [ns].
    """

    def __init__(self, classifier: PointNet, cost: CostModel, cpu_ns: Callable[[], int]) -> None:
        self._classifier, self._cost, self._cpu_ns = classifier, cost, cpu_ns

    def classify(self, points: Float32, proposals: Proposals, which: Int) -> Float64:
        """(R, 4) probability of each class for each of the proposals given, in their order."""
        before = self._cpu_ns()
        likelihood = self._classifier.classify(points, proposals, which)
        self._cost.learn(proposals.count[which], (self._cpu_ns() - before) / 1e6)
        return likelihood

    def facts(self) -> dict[str, str]:
        """The model's file and hash."""
        return self._classifier.facts()
