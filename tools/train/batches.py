"""Sampling of training batches by class, variant and height."""

from __future__ import annotations

import numpy as np
from numpy.random import Generator

from modt.classes import N_CLASSES
from modt.types import Float64, Int
from tools.train.dataset import Dataset

CLASS_SHARE = np.array([0.46, 0.24, 0.16, 0.14])
"""Share of each class in a batch; objects are rarer, background is more varied."""
VARIANT_SHARE = np.array(
    [[0.4, 0.35, 0.0, 0.25], [0.3, 0.25, 0.3, 0.15], [0.2, 0.15, 0.3, 0.35], [0.2, 0.15, 0.3, 0.35]]
)
"""Share of each variant (shipped, clustered, pasted, synthetic) in each class, where present; more generated crops
for the classes that are rare in real scans."""
TALL_SHARE = 0.3
"""Share of vans among the cars."""
BATCH_SIZE = 128
"""Labelled crops of a step."""
Pools = list[tuple[Int, Float64 | None]]
"""Rows of each class, and the probability of each row, None where they are equal."""


def sampling_pools(data: Dataset, rows: Int, worth: Float64 | None = None) -> Pools:
    """Rows of each class and the probability of each row: equal within a class, variant and height.

    Args:
        data: all crops.
        rows: to draw from.
        worth: (len(data),) relative probability within these groups, equal by default.
    """
    worth = np.ones(len(data)) if worth is None else worth
    pools: Pools = []
    for c in range(N_CLASSES):
        own = rows[data.label[rows] == c]
        group = 2 * data.variant[own] + data.tall[own]
        share = np.outer(VARIANT_SHARE[c], [1 - TALL_SHARE, TALL_SHARE]).ravel()
        total = np.bincount(group, worth[own], minlength=len(share))
        weight = worth[own] * (share / np.where(total > 0, total, 1.0))[group]
        pools.append((own, weight / weight.sum()))
    return pools


def draw_batch(pools: Pools, rng: Generator, n: int = BATCH_SIZE, share: Float64 = CLASS_SHARE) -> Int:
    """(n,) rows, classes by their shares; none of a class without rows."""
    number = rng.multinomial(n, share / share.sum())
    drawn = zip(pools, number, strict=True)
    return np.concatenate([rng.choice(own, k, p=p) for (own, p), k in drawn if len(own)])
