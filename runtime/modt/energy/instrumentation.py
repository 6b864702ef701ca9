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
    """Books the points that the network works on, which the number of its results does not tell.

    Args:
        classifier: that does the work.
        ledger: to book on.
        max_points: of a proposal that the network is given.
        batch: proposals of one network call; they are sorted by size and padded to the largest among them.
    """

    def __init__(self, classifier: Classifier, ledger: StageLedger, max_points: int, batch: int) -> None:
        self._classifier, self._ledger = classifier, ledger
        self._max_points, self._batch = max_points, batch

    def classify(self, points: Float32, proposals: Proposals, which: Int) -> Float64:
        """(R, 4) P(Y|X) of the proposals named, in their order."""
        self._ledger.count(
            "classification", points=padded_points(proposals.count[which], self._max_points, self._batch)
        )
        return self._classifier.classify(points, proposals, which)

    def facts(self) -> dict[str, str]:
        """The model's file and hash."""
        return self._classifier.facts()


def padded_points(count: Int, max_points: int, batch: int) -> int:
    """Points of which the network computes features, padding included, for proposals of (R,) count points.

    Args:
        count: points of each proposal.
        max_points: of a proposal that the network is given.
        batch: proposals of one network call.
    """
    size = np.sort(np.minimum(count, max_points))
    ends = np.minimum(np.arange(batch, len(size) + batch, batch), len(size))
    return int(np.diff(ends, prepend=0) @ size[ends - 1])
