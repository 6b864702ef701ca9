"""A classifier that teaches the scheduler what it costs."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

from modt.classification.scheduler import CostModel
from modt.types import Float32, Float64, Int, Proposals


class Classifier(Protocol):
    """Points to class likelihoods."""

    def classify(self, points: Float32, proposals: Proposals, which: Int) -> Float64:
        """(R, 4) P(Y|X) of the proposals given."""
        ...


class Metered:
    """The same classifier, timed.

    Args:
        classifier: the one that does the work.
        cost: learns from every frame.
        cpu_ns: clock of this thread's CPU time [ns].
    """

    def __init__(self, classifier: Classifier, cost: CostModel, cpu_ns: Callable[[], int]) -> None:
        self.classifier, self.cost, self.cpu_ns = classifier, cost, cpu_ns

    def classify(self, points: Float32, proposals: Proposals, which: Int) -> Float64:
        """(R, 4) P(Y|X) of the proposals given."""
        before = self.cpu_ns()
        likelihood = self.classifier.classify(points, proposals, which)
        self.cost.learn(proposals.count[which], (self.cpu_ns() - before) * 1e-6)
        return likelihood
