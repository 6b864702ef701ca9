"""Number of points that the network processes, padding included."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np

from modt.config import ClassificationConfig
from modt.types import Int


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
