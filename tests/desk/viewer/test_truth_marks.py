import numpy as np
import pytest

from modt.geometry import se3
from modt_desk.evaluation.truth import KITTI_TYPES, FrameTruth
from modt_desk.viewer.truth_marks import _objects, points_in_boxes


def test_points_are_of_the_proposal_in_whose_box_they_lie():
    box = {"x": 5.0, "y": 1.0, "z": 0.0, "l": 4.0, "w": 2.0, "h": 1.5, "yaw": np.pi / 2}
    tracks = [{"box": None, "proposal": None}, {"box": box, "proposal": 3}]
    points = np.array([[5, 1, 0, 0], [5, 2.9, 0.7, 0], [6.9, 1, 0, 0], [5, 1, 0.9, 0], [-5, 1, 0, 0]], np.float32)
    np.testing.assert_array_equal(points_in_boxes({"tracks": tracks}, points), [3, 3, -1, -1, -1])


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
