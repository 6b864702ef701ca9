"""Point labels."""

import numpy as np

from modt.sinks.kitti import PointLabels, encode
from tests.results import CAR, PEDESTRIAN, result


def test_every_point_of_the_input_has_its_label_in_order(tmp_path):
    sink = PointLabels(tmp_path / "labels")
    sink.write(result(5, [3, 2], {0: 8, 1: 9}, {8: CAR, 9: PEDESTRIAN}, n_points=7))
    labels = np.fromfile(tmp_path / "labels" / "000005.label", np.uint32)
    assert (labels >> 16).tolist() == [1, 1, 1, 2, 2, 0, 0]
    assert (labels & 0xFFFF).tolist() == [1, 1, 1, 2, 2, 0, 0]


def test_a_frame_without_proposals_is_all_zero():
    assert encode(result(0, [], {}, n_points=4)).tolist() == [0, 0, 0, 0]
