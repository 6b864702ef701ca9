"""Points and labelled objects as the page draws them."""

import numpy as np
import pytest

from modt.geometry import se3
from modt.profile import load
from modt.viewer.packed import SIDE
from modt_desk.evaluation.truth import KITTI_TYPES, FrameTruth
from modt_desk.simulation.synthetic_stream import SyntheticStream
from modt_desk.viewer.truth_marks import _objects
from modt_desk.viewer.view import Grid


def test_a_cell_shows_its_highest_point_and_ground_as_such():
    config = load("vlp-16")
    points = next(iter(SyntheticStream("street", "vlp-16", 0.1, seed=2))).points
    grid = Grid(config)
    pole = np.zeros((5, 4), np.float32)
    pole[:, :2] = 9.01, -4.01
    pole[:, 2] = -config.sensor.height_m + np.array([0.5, 2.0, 1.0, 1.5, 0.7])
    without, cells = (grid.cells(given) for given in (points, np.concatenate([points, pole])))
    column, row = (int(np.floor(v * 100 / grid.step_cm)) + SIDE // 2 for v in (9.01, -4.01))
    (level,) = cells.level[cells.cell == SIDE * row + column]
    assert 18 <= level <= 22
    assert (np.diff(cells.cell) > 0).all()
    ground = without.level == 0
    assert 0.2 < ground.mean() < 0.9
    x = ((without.cell % SIDE) + 0.5 - SIDE / 2) * grid.step_cm / 100
    assert np.abs(x).max() < config.sensor.max_range_m


def test_an_object_is_drawn_where_the_sensor_sees_it():
    T = se3(np.eye(3), np.array([10.0, 0.0, 0.0]))
    boxes = [[14, 2, 0, 4, 2, 1.5, 0.1], [15, 2, 0, 1, 1, 1.5, 0], [16, 2, 0, 4, 2, 1.5, 0], [0, 0, 0, 1, 1, 1, 0]]
    truth = FrameTruth.of(KITTI_TYPES, [1, 2, 3, 4], ["Car", "Pedestrian", "Car", "Tram"], boxes, T_box_sensor=T)
    rows = np.zeros(4, [("reported", int), ("class", int), ("to_segment", bool), ("to_classify", bool)])
    rows["class"], rows["reported"], rows["to_segment"], rows["to_classify"] = (
        truth.object_class, [1, 1, -1, 1], [1, 1, 0, 1], [1, 1, 1, 1],
    )  # fmt: skip
    objects = _objects(truth, rows)
    assert [(o["class"], o["outcome"]) for o in objects] == [(1, "found"), (2, "missed"), (1, "not judged")]
    assert [objects[0][key] for key in ("x", "y", "l", "w", "yaw")] == pytest.approx([4, 2, 4, 2, 0.1])
