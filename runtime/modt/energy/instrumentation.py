"""A classifier that counts the points it processes."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Protocol

import numpy as np

from modt.config import ClassificationConfig
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
    """Adds the points processed by the network, padding included, to the ledger's classification entry.

    Args:
        classifier: that classifies.
        ledger: that is added to.
        size: points that the network processes for proposals of (R,) points.
    """

    def __init__(self, classifier: Classifier, ledger: StageLedger, size: Callable[[Int], int]) -> None:
        self._classifier, self._ledger, self._size = classifier, ledger, size
        self.facts = classifier.facts

    def classify(self, points: Float32, proposals: Proposals, which: Int) -> Float64:
        """(R, 4) P(Y|X) of the R proposals given by index, in their order."""
        self._ledger.count("classification", points=self._size(proposals.count[which]))
        return self._classifier.classify(points, proposals, which)


def padded_size(limits: ClassificationConfig) -> Callable[[Int], int]:
    """Points that the network processes, padding included, for proposals of (R,) points."""
    return partial(padded_points, max_points=limits.max_points, batch=limits.batch, min_points=limits.min_points)


def padded_points(count: Int, max_points: int, batch: int, min_points: int = 1) -> int:
    """Points processed by the network, padding included, for R proposals of (R,) count points.

    A call takes a batch of proposals, sorted by size, of max_points each at most, padded to the largest of them and
    to min_points.
    """
    size = sorted(max(min(n, max_points), min_points) for n in count.tolist())  # few: faster than arrays
    return sum(len(size[k : k + batch]) * size[k : k + batch][-1] for k in range(0, len(size), batch))


def padded_each(count: Int, limits: ClassificationConfig) -> Int:
    """(R,) the same of each proposal."""
    size = np.maximum(np.minimum(count, limits.max_points), limits.min_points)
    order = np.argsort(size, kind="stable")
    last = np.minimum(np.arange(len(size)) // limits.batch * limits.batch + limits.batch, len(size)) - 1
    size[order] = size[order[last]]
    return size
