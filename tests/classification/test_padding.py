"""Points that the network processes."""

import numpy as np
import pytest

from modt.classification.scheduler import padded_each, padded_size
from modt.config import ClassificationConfig


@pytest.mark.parametrize(("batch", "points"), [(1, 10 + 290 + 400), (2, 2 * 290 + 400), (8, 3 * 400)])
def test_points_are_counted_with_padding(batch: int, points: int) -> None:
    limits, count = ClassificationConfig(max_points=400, batch=batch), np.array([10, 700, 290])
    assert padded_size(limits)(count) == padded_each(count, limits).sum() == points


def test_nothing_to_classify_has_no_points() -> None:
    assert padded_size(ClassificationConfig())(np.zeros(0, np.int64)) == 0
