"""KITTI tracking results, read back by the benchmark's definitions."""

from dataclasses import replace

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from modt.geometry import corners
from modt.placement import Mount
from modt.sinks.kitti import KittiResults
from tests.geometry.test_transforms import forward_camera
from tests.results import CAR, proposals, result


def written(tmp_path, frame_result, camera):
    sink = KittiResults(tmp_path / "kitti" / "0000.txt", camera)
    sink.write(frame_result)
    sink.close()
    return [line.split() for line in (tmp_path / "kitti" / "0000.txt").read_text().splitlines()]


def result_of(box):
    """Result of a frame with a car that was seen in a (1, 7) box."""
    return replace(result(0, [5], {0: 1}, {1: CAR}), proposals=proposals([5], box))


def test_only_tracks_of_a_class_with_a_proposal_are_written(tmp_path):
    (row,) = written(tmp_path, result(4, [5, 5], {0: 1, 1: 2}, {1: CAR, 3: CAR}, lost=(3,)), forward_camera())
    assert (row[:3], len(row)) == (["4", "1", "Car"], 18)


@given(
    x=st.floats(5, 40),
    y=st.floats(-5, 5),
    yaw=st.floats(-3.1, 3.1),
    size=st.tuples(st.floats(1, 5), st.floats(0.5, 2), st.floats(0.5, 2)),
)
def test_the_benchmark_decodes_the_same_box(tmp_path_factory, x, y, yaw, size):
    box = np.array([[x, y, -0.5, *size, yaw]])
    shown = result_of(box)
    row = written(tmp_path_factory.mktemp("k"), shown, forward_camera())[0]
    h, w, length, cx, cy, cz, ry = map(float, row[10:17])
    # The benchmark's corners: x right, z forward, the box turned by ry about the downward axis.
    local = np.array([[length, w], [length, -w], [-length, -w], [-length, w]]) / 2
    right = np.cos(ry) * local[:, 0] + np.sin(ry) * local[:, 1] + cx
    ahead = -np.sin(ry) * local[:, 0] + np.cos(ry) * local[:, 1] + cz
    found = np.stack([ahead, -right], axis=1)
    distance = np.linalg.norm(found[:, None] - corners(box)[0, :, :2], axis=2)
    assert max(distance.min(axis=0).max(), distance.min(axis=1).max()) < 0.02
    assert np.isclose(cy, 0.5 + h / 2, atol=1e-2)  # the bottom, y down from the camera
    left, top, right_px, bottom = map(float, row[6:10])
    assert 0 <= left <= right_px <= 199
    assert 0 <= top <= bottom <= 99


def test_without_a_camera_coordinates_are_written_without_image_boxes(tmp_path):
    row = written(tmp_path, result(0, [5], {0: 1}, {1: CAR}), None)[0]
    assert row[6:10] == ["-1.00"] * 4
    assert np.allclose([float(v) for v in row[13:16]], [0, 1.75, 10])


def test_boxes_of_a_tilted_sensor_are_those_of_its_camera(tmp_path):
    box = np.array([[12.0, 2.0, -0.5, 4.0, 1.8, 1.5, 0.0]])
    shown = result_of(box)
    mount = Mount.of(0.0, 10.0)
    tilted = replace(shown, frame=replace(shown.frame, R_level_sensor=mount.R_level_sensor))
    level = written(tmp_path / "level", shown, forward_camera())[0]
    (row,) = written(tmp_path / "tilted", tilted, forward_camera())
    assert row == written(tmp_path / "camera", shown, mount.camera(forward_camera()))[0]
    assert row[13:16] != level[13:16]
