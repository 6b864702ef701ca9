"""Which crops a batch shows: classes, variants and heights by fixed shares."""

from __future__ import annotations

import numpy as np
from numpy.random import Generator

from modt.classes import N_CLASSES
from modt.types import Float64, Int
from tools.train.dataset import Dataset

SHARE = np.array([0.46, 0.24, 0.16, 0.14])
"""Of each class in a batch: objects are rare, and background has many faces."""
MIX = np.array([[0.4, 0.35, 0.0, 0.25], [0.3, 0.25, 0.3, 0.15], [0.2, 0.15, 0.3, 0.35], [0.2, 0.15, 0.3, 0.35]])
"""Of each variant (shipped, clustered, pasted, synthetic) among the crops of each class, where there are such: the
rarer a class is in real scans, the more of it is made."""
TALL = 0.3
"""Of vans among the cars."""
BATCH = 128
"""Labelled crops of a step."""


def odds(data: Dataset, rows: Int) -> list[tuple[Int, Float64]]:
    """Rows of each class and how likely each is drawn: crops of one class, variant and height alike."""
    pools = []
    for c in range(N_CLASSES):
        own = rows[data.label[rows] == c]
        group = 2 * data.variant[own] + data.tall[own]
        share = np.outer(MIX[c], [1 - TALL, TALL]).ravel()
        weight = (share / np.bincount(group, minlength=len(share)).clip(1))[group]
        pools.append((own, weight / weight.sum()))
    return pools


def draw(pools: list[tuple[Int, Float64]], rng: Generator) -> Int:
    """Rows of one batch, classes by their share."""
    number = rng.multinomial(BATCH, SHARE / SHARE.sum())
    return np.concatenate([rng.choice(own, k, p=p) for (own, p), k in zip(pools, number, strict=True)])
