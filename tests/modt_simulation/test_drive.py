"""A synthetic drive on disk, read back like a recorded one."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from modt.cli.main import main
from modt.geometry import inverse, transform, transform_boxes, wrap
from modt.sources.recognise import open_stream
from modt_evaluation.overlap import inside as within
from modt_evaluation.truth_files import open_truth
from modt_simulation.kitti_raw import DATE
from modt_simulation.synthetic_stream import SyntheticStream
from tests.recorded import written


@pytest.fixture(scope="module")
def drive(tmp_path_factory):
    """A street on disk: its writer, its stream, its sweeps."""
    stream = SyntheticStream("street", "vlp-16", 1.5, seed=4)
    return written(tmp_path_factory.mktemp("drive"), stream), stream, list(stream.sweeps())


@pytest.mark.parametrize("layout", ["drive", "sequence"])
def test_points_times_poses_and_camera_are_read_back(drive, layout):
    writer, stream, sweeps = drive
    read = open_stream(getattr(writer, layout))
    frames = list(read)
    assert [f.index for f in frames] == [f.index for f, _ in sweeps]
    first_read = frames[0]
    first = sweeps[0][0]
    for mine, (frame, _) in zip(frames, sweeps, strict=True):
        assert_array_equal(mine.points, frame.points)
        assert mine.stamp_s == pytest.approx(frame.stamp_s, abs=1e-6)
        assert_allclose(
            inverse(first_read.T_world_sensor) @ mine.T_world_sensor,
            inverse(first.T_world_sensor) @ frame.T_world_sensor,
            atol=1e-4,
        )
    assert_allclose(read.info.camera.P_image_sensor, stream.info.camera.P_image_sensor, atol=1e-9)
    assert read.info.notes == read.info.pose_notes == ()


@pytest.mark.parametrize(("distort", "turn_s"), [(False, 0.0), (True, 0.1)])
def test_the_timestamps_tell_whether_sweeps_are_distorted(tmp_path, distort, turn_s):
    stream = SyntheticStream("street", "vlp-16", 0.3, seed=4, distort=distort)
    assert [frame.turn_s for frame in stream] == [turn_s] * 3
    writer = written(tmp_path, stream)
    read = open_stream(writer.drive)
    assert_allclose([f.turn_s for f in read], turn_s, atol=1e-9)
    starts, stamps = ((writer.drive / "velodyne_points" / f"timestamps{k}.txt").read_text() for k in ("_start", ""))
    assert (starts == stamps) is not distort


def test_tracklets_hold_the_boxes_in_view_of_the_camera(drive):
    writer, _, ((_, truth), *_) = drive
    labelled = open_truth(writer.drive).frames[0]
    assert len(labelled.id) > 3
    seen = transform_boxes(inverse(labelled.T_box_sensor), labelled.box)
    off = np.linalg.norm(seen[:, None, :6] - truth.boxes[:, :6], axis=2)
    assert off.min(axis=1).max() < 1e-5
    assert labelled.box[:, 0].min() > 0
    assert set(labelled.type_) <= {"Car", "Van", "Truck", "Pedestrian", "Cyclist"}


def test_tracklets_of_a_walking_robot_hold_the_points_of_their_bodies(tmp_path):
    stream = SyntheticStream("street", "vlp-16", 0.5, seed=4, gait="6")
    writer = written(tmp_path, stream)
    labels = open_truth(writer.drive).frames
    inside = total = 0
    for frame, truth in stream.sweeps():
        labelled = labels[frame.index]
        T = frame.T_world_sensor
        placed = transform_boxes(T @ inverse(labelled.T_box_sensor), labelled.box)
        for box in placed:
            body = np.argmin(np.linalg.norm(truth.world_boxes[:, :3] - box[:3], axis=1))
            assert_allclose(truth.world_boxes[body, :6], box[:6], atol=1e-5)
            assert abs(wrap(truth.world_boxes[body, 6] - box[6])) < 1e-5
            points = transform(T, frame.points[truth.instance == truth.bodies[body], :3].astype(np.float64))
            inside += np.count_nonzero(within(points, box, foot_m=-0.15))
            total += len(points)
    assert total > 500
    assert inside > 0.98 * total


def test_labels_hold_class_and_instance(drive):
    writer, _, sweeps = drive
    for frame, truth in sweeps[:3]:
        packed = np.fromfile(writer.sequence / "labels" / f"{frame.index:06d}.label", np.uint32)
        assert_array_equal(packed & 0xFFFF, truth.semantic)
        number = (packed >> 16).astype(int)
        for row, body in enumerate(truth.bodies):
            assert_array_equal(number == row + 1, truth.instance == body)


def test_an_existing_drive_is_not_overwritten(tmp_path, capsys):
    (tmp_path / DATE).mkdir()
    assert main(["simulate", "--out", str(tmp_path)]) == 2
    assert "already" in capsys.readouterr().err
