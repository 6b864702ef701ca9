"""Columns over frames in bounded memory."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from modt_desk.reporting.run_sums import FrameSeries


@given(st.lists(st.integers(0, 100), min_size=1, max_size=200))
def test_points_hold_the_sums_of_their_frames(values: list[int]) -> None:
    series = FrameSeries(1, points=8)
    for value in values:
        series.add([value])
    frames, means = series.frames, series.means[:, 0]
    assert len(frames) == len(means) <= 8
    ends = np.cumsum(frames)
    assert ends[-1] == series.count == len(values)
    assert set(frames[:-1].tolist()) <= {series.frames_a_point}
    expected = [np.mean(part) for part in np.split(np.array(values), ends[:-1])]
    np.testing.assert_allclose(means, expected)
    assert series.total[0] == pytest.approx(sum(values))
