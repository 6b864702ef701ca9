"""Paths and timetables."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from modt_desk.simulation.motion import Path, timetable


@given(st.lists(st.floats(0.1, 12), min_size=2, max_size=20), st.floats(1, 60))
def test_the_distance_of_a_timetable_lies_between_those_of_its_extreme_speeds(speeds, seconds):
    time, travelled = timetable(seconds, np.array(speeds))
    assert time[-1] == pytest.approx(seconds)
    assert (np.diff(travelled) > 0).all()
    assert min(speeds) * seconds <= travelled[-1] * (1 + 1e-9) <= max(speeds) * seconds * (1 + 1e-6)


def test_a_body_follows_the_line_at_its_speed_and_stops_at_its_end():
    path = Path.steady(np.array([[0.0, 0.0], [10.0, 0.0], [10.0, 10.0]]), 2.0, 4.0, 10.0)
    assert path.at(1.0) == pytest.approx((6.0, 0.0, np.pi / 20), abs=1e-9)
    assert path.at(4.0)[:2] == pytest.approx((10.0, 8.0))
    assert path.at(9.0)[:2] == pytest.approx((10.0, 10.0))
    assert path.at(9.0)[2] == pytest.approx(np.pi / 2)
    assert path.speed(1.0) == pytest.approx(4.0)
    assert path.speed(9.0) == 0.0
    assert Path.standing(1.0, 2.0, 0.5).at(3.0) == (1.0, 2.0, 0.5)
