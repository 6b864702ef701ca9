"""The sweep-skew study recognises compensated sweeps by the bearings of edges."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tools.study.sweep_skew import displacement_m


@given(st.floats(-0.4, 0.4), st.floats(-0.4, 0.4))
def test_displacement_is_measured_from_the_bearings_of_edges(left_m, right_m):
    bearing = np.deg2rad(np.arange(0, 360, 0.2))
    distance = np.where(np.arange(len(bearing)) // 7 % 2, 6.0, 20.0)
    x, y = distance * np.cos(bearing), distance * np.sin(bearing)
    points = np.stack([x + np.where(y > 0, left_m, right_m), y, 0 * x, 0 * x], axis=1).astype(np.float32)
    assert displacement_m(points, 90.0)[0] == pytest.approx(left_m, abs=0.02)
    assert displacement_m(points, -90.0)[0] == pytest.approx(right_m, abs=0.02)
    assert np.isnan(displacement_m(points[:0], 90.0)[0])
