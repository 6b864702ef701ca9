"""Scenes from KITTI label files: objects stand where the file states."""

import numpy as np

from tools.train.synthetic_scans import label_scene


def test_objects_of_a_label_file_stand_where_it_states(tmp_path):
    path = tmp_path / "000000.txt"
    path.write_text(
        "Car 0 0 0 0 0 9 9 1.5 1.6 4.0 2.0 1.7 15.0 -1.57\n"
        "Pedestrian 0 0 0 0 0 9 9 1.8 0.6 0.8 -3.0 1.7 9.0 0.3\n"
        "Cyclist 0 0 0 0 0 9 9 1.7 0.6 1.8 6.0 1.7 12.0 1.2\n"
        "DontCare -1 -1 -10 5 5 9 9 -1 -1 -1 -1000 -1000 -1000 -10\n"
    )
    _, truth = label_scene(path, seed=0).sweep(0)
    assert [k.name for k in truth.kinds] == ["Car", "Pedestrian", "Cyclist"]
    np.testing.assert_allclose(truth.boxes[0, [0, 1, 3, 4, 5]], [15.27, -2.0, 4.0, 1.6, 1.5], atol=0.1)
    np.testing.assert_allclose(truth.boxes[1, :2], [9.27, 3.0], atol=0.1)
    assert (truth.points > 50).all()
