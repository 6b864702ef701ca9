"""Scores of classifiers."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tools.train.scores import average_precision, confusion


@given(
    st.lists(st.tuples(st.integers(0, 3), st.floats(0, 1)), min_size=1, max_size=40),
    st.integers(0, 5),
)
def test_average_precision_agrees_with_the_definition(rows: list[tuple[int, float]], missed: int) -> None:
    label = np.array([r[0] for r in rows])
    score = np.array([r[1] for r in rows])
    probability = np.c_[1 - score, score, np.zeros((len(rows), 2))]
    truth = np.bincount(label, minlength=4)
    truth[1] += missed
    order = np.argsort(-score, kind="stable")
    points, true = [], 0
    for k, i in enumerate(order, start=1):
        true += label[i] == 1
        points.append((true / max(truth[1], 1), true / k))
    area, before = 0.0, 0.0
    for k, (recall, _) in enumerate(points):
        area += (recall - before) * max(p for _, p in points[k:])
        before = recall
    assert average_precision(probability, label, truth)["car"] == pytest.approx(area, abs=1e-3)


def test_confusion_counts_predictions_by_true_class() -> None:
    probability = np.eye(4)[[0, 1, 1, 3]]
    assert confusion(probability, np.array([0, 1, 2, 3]))[2] == [0, 1, 0, 0]
