"""A classifier that counts the points it processes."""

from __future__ import annotations

from typing import Protocol

import numpy as np

from modt.energy.ledger import StageLedger
from modt.types import Float32, Float64, Int, Proposals


class Classifier(Protocol):
    """Points to class likelihoods."""

    def classify(self, points: Float32, proposals: Proposals, which: Int) -> Float64:
        """(R, 4) P(Y|X) of the R proposals given by index."""
        ...

    def facts(self) -> dict[str, str]:
        """File and hash of the model."""
        ...


class CountingClassifier:
    """Adds the points processed by the network, padding included, to the ledger's classification entry."""

    def __init__(self, classifier: Classifier, ledger: StageLedger, max_points: int, batch: int) -> None:
        self._classifier, self._ledger = classifier, ledger
        self._max_points, self._batch = max_points, batch
        self.facts = classifier.facts

    def classify(self, points: Float32, proposals: Proposals, which: Int) -> Float64:
        """(R, 4) P(Y|X) of the R proposals given by index, in their order."""
        points_processed = padded_points(proposals.count[which], self._max_points, self._batch)
        self._ledger.count("classification", points=points_processed)
        return self._classifier.classify(points, proposals, which)


def padded_points(count: Int, max_points: int, batch: int) -> int:
    """Points processed by the network, padding included, for R proposals of (R,) count points.

    A call takes a batch of proposals, sorted by size, of max_points each at most, padded to the largest of them.
    """
    size = np.sort(np.minimum(count, max_points))
    ends = np.minimum(np.arange(batch, len(size) + batch, batch), len(size))
    return int(np.diff(ends, prepend=0) @ size[ends - 1])
