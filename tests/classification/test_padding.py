"""Points that the network processes."""

from dataclasses import replace

import numpy as np
import pytest

from modt.classification.scheduler import padded_size
from modt.config import ClassificationConfig


@pytest.mark.parametrize(("likelihood", "points"), [("network", 6 * 400), ("pooled", 4 * 290 + 2 * 400)])
def test_points_are_counted_with_padding(likelihood: str, points: int) -> None:
    limits, count = ClassificationConfig(likelihood=likelihood), np.array([10, 700, 290, 10, 20, 400])
    limits = replace(limits, max_points=400)
    assert padded_size(limits)(count) == points


def test_nothing_to_classify_has_no_points() -> None:
    assert padded_size(ClassificationConfig())(np.zeros(0, np.int64)) == 0
