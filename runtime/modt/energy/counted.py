"""A classifier whose points are booked."""

from __future__ import annotations

from typing import Protocol

import numpy as np

from modt.energy.ledger import StageLedger
from modt.types import Float32, Float64, Int, Proposals


class Classifier(Protocol):
    """Points to class likelihoods."""

    def classify(self, points: Float32, proposals: Proposals, which: Int) -> Float64:
        """(R, 4) P(Y|X) of the proposals named."""
        ...

    def facts(self) -> dict[str, str]:
        """The model's file and hash."""
        ...


class CountedClassifier:
    """Books the points that the network sees, which the number of its results does not tell.

    Args:
        classifier: that does the work.
        ledger: to book on.
        max_points: of a proposal that the network is given.
    """

    def __init__(self, classifier: Classifier, ledger: StageLedger, max_points: int) -> None:
        self._classifier, self._ledger, self._max_points = classifier, ledger, max_points

    def classify(self, points: Float32, proposals: Proposals, which: Int) -> Float64:
        """(R, 4) P(Y|X) of the proposals named, in their order."""
        seen = np.minimum(proposals.count[which], self._max_points).sum()
        self._ledger.count("classification", points=int(seen))
        return self._classifier.classify(points, proposals, which)

    def facts(self) -> dict[str, str]:
        """The model's file and hash."""
        return self._classifier.facts()
