"""Sampling of training batches."""

from __future__ import annotations

import numpy as np

from modt.classification.crops import Crops
from tests.tools.train.datasets import data_of
from tools.train.batches import sampling_pools
from tools.train.dataset import CLUSTERED, SHIPPED


def test_worth_counts_within_a_class_and_variant() -> None:
    label = np.array([0, 0, 0, 0, 1, 2, 3])
    variant = np.array([SHIPPED, SHIPPED, SHIPPED, CLUSTERED, SHIPPED, SHIPPED, SHIPPED])
    data = data_of(Crops(np.zeros((7, 3), np.float32), np.arange(8)), label, variant=variant)
    worth = np.array([1.0, 3.0, 0.5, 0.1, 1.0, 1.0, 1.0])
    rows = np.array([0, 1, 3, 4, 5, 6])
    _, equal = sampling_pools(data, rows)[0]
    (own, share), *others = sampling_pools(data, rows, worth)
    assert own.tolist() == [0, 1, 3]
    np.testing.assert_allclose(share, np.array([0.25, 0.75, 0.35 / 0.4]) / (1 + 0.35 / 0.4))
    np.testing.assert_allclose(equal, [share[:2].mean()] * 2 + [share[2]])
    assert [p.tolist() for _, p in others] == [[1.0]] * 3
