"""Collisions: the separating axis test against polygons, and which body stays."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from shapely.geometry import Polygon

from modt.geometry import corners
from modt_simulation.builder import overlapping, without_collisions
from modt_simulation.motion import Path, timetable

place = st.floats(-4, 4)
side = st.floats(0.5, 5)
turn = st.floats(-3.2, 3.2)
boxes = st.tuples(place, place, st.just(0.0), side, side, st.just(1.0), turn).map(np.array)


@given(boxes, boxes)
def test_overlap_agrees_with_that_of_polygons(a, b):
    found = bool(overlapping(a[None], b[None])[0])
    (one,), (other,) = (map(Polygon, corners(box[None])) for box in (a, b))
    assert found == one.intersects(other) or one.boundary.distance(other.boundary) < 1e-9


def test_of_two_colliding_bodies_the_first_stays():
    mover = (Path.steady(np.array([[0.0, 0.0], [20.0, 0.0]]), 0.0, 5.0, 3.0), (2.0, 1.0))
    obstacle = (Path.standing(12.0, 0.0, 0.0), (1.0, 1.0))
    beside = (Path.standing(12.0, 3.0, 0.0), (1.0, 1.0))
    flat = (Path.standing(12.0, 0.0, 0.0), (0.0, 0.0))
    beyond = (Path.standing(19.5, 0.0, 0.0), (1.0, 1.0))

    def stay(*bodies):
        paths, footprints = zip(*bodies, strict=True)
        return without_collisions(paths, np.array(footprints), 3.0).tolist()

    assert stay(mover, obstacle, beside, flat, beyond) == [True, False, True, True, True]
    assert stay(obstacle, mover) == [True, False]


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
