"""Poses from files: their coordinate frames, and the errors of invalid files."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation

from modt.errors import MisuseError
from modt.geometry import Camera, inverse, rotation_zyx, se3
from modt.poses.pose_source import NoPoses, PoseFile, PoseSource
from modt.sources.kitti_calibration import oxts_poses
from modt.sources.pose_file import read_poses
from modt.sources.recognise import open_stream
from tests.sources import layouts

T_CAMERA_SENSOR = np.array([[0.0, -1, 0, 0.1], [0, 0, -1, -0.08], [1, 0, 0, -0.27], [0, 0, 0, 1]])
CAMERA = Camera(np.zeros((3, 4)), T_CAMERA_SENSOR, 100.0, 100.0)
angle = st.floats(-3, 3)
place = st.floats(-1000, 1000)
pose = st.builds(lambda r, p, y, *xyz: se3(rotation_zyx(r, p, y), np.array(xyz)), *[angle] * 3, *[place] * 3)


def write(path, poses):
    np.savetxt(path, [T[:3].ravel() for T in poses])
    return path


@given(st.lists(pose, min_size=1, max_size=5))
def test_poses_are_read_back(tmp_path_factory, poses):
    path = write(tmp_path_factory.mktemp("poses") / "p.txt", poses)
    assert_allclose(read_poses(path), poses, atol=1e-9)


GOOD = "1 0 0 0 0 1 0 0 0 0 1 0\n"


@pytest.mark.parametrize(
    ("text", "named"),
    [
        (None, "No such file"),
        ("", "no poses"),
        (GOOD + "1 0 0\n", r"p\.txt:2: 3 numbers, not 12"),
        (GOOD * 2 + "1 0 0 0 0 1 0 0 0 0 1 x\n", r"p\.txt:3: no numbers"),
        (GOOD + "1 0 0 nan 0 1 0 0 0 0 1 0\n", r"p\.txt:2: not finite"),
        ("2 0 0 0 0 1 0 0 0 0 1 0\n", r"p\.txt:1: no rotation"),
        ("1 0 0 5e8 0 1 0 0 0 0 1 0\n", r"p\.txt:1: farther than 100000 km"),
    ],
)
def test_an_invalid_file_is_refused_with_its_line(tmp_path, text, named):
    path = tmp_path / "p.txt"
    if text is not None:
        path.write_text(text, encoding="utf-8")
    with pytest.raises(MisuseError, match=named):
        read_poses(path)


def test_camera_poses_are_converted_and_sensor_poses_unchanged(tmp_path):
    frame = next(iter(open_stream(layouts.bare(tmp_path))))
    T_sensor = se3(rotation_zyx(0.01, -0.02, 0.7), np.array([3.0, -2.0, 0.1]))
    path = write(tmp_path / "p.txt", [T_CAMERA_SENSOR @ T_sensor @ inverse(T_CAMERA_SENSOR)])
    assert_allclose(PoseFile(path, CAMERA, 1).place(frame).T_world_sensor, T_sensor, atol=1e-9)
    path = write(tmp_path / "q.txt", [T_sensor])
    assert_allclose(PoseFile(path, None, 1).place(frame).T_world_sensor, T_sensor, atol=1e-9)


def test_a_line_belongs_to_the_frame_of_its_index(tmp_path):
    stream = open_stream(layouts.raw_drive(tmp_path, [0, 1, 4]))
    path = write(tmp_path / "p.txt", [se3(np.eye(3), np.array([0.0, 0.0, float(k)])) for k in range(5)])
    poses = PoseFile(path, stream.info.camera, stream.info.end)
    # z of this camera is x of the sensor
    assert [poses.place(frame).T_world_sensor[0, 3] for frame in stream] == [0, 1, 4]
    assert [poses.place(frame).T_world_sensor[0, 3] for frame in stream.between(1, 5)] == [1, 4]


def test_a_source_of_poses_says_whether_a_stream_has_some(tmp_path):
    path = write(tmp_path / "p.txt", [np.eye(4)] * 4)
    for build, recorded in ((layouts.raw_drive, True), (layouts.bare, False)):
        stream = open_stream(build(tmp_path))
        for poses, known in ((PoseSource(), recorded), (NoPoses(), False), (PoseFile(path, None, None), True)):
            assert poses.of_stream(stream.info).has_poses is known
            assert all((poses.place(frame).T_world_sensor is not None) is known for frame in stream)


def test_too_few_lines_are_refused_before_the_start_if_the_end_is_known(tmp_path):
    stream = open_stream(layouts.raw_drive(tmp_path, [0, 1, 4]))
    path = write(tmp_path / "p.txt", [np.eye(4)] * 3)
    assert PoseFile(path, None, stream.between(0, 2).info.end)
    for end, frames in ((stream.info.end, []), (None, stream)):
        with pytest.raises(MisuseError, match="3 poses, too few for frame 4"):
            list(map(PoseFile(path, None, end).place, frames))


small = st.floats(-1e-3, 1e-3)
records = arrays(np.float64, (4, 6), elements=small).map(lambda a: a + np.array([49.0, 8.4, 110.0, 0.01, 0.02, 1.0]))


def mercator_pose(record, scale):
    lat, lon, alt, *roll_pitch_yaw = record
    er = 6378137.0
    tx = scale * lon * math.pi * er / 180
    ty = scale * er * math.log(math.tan((90 + lat) * math.pi / 360))
    return se3(Rotation.from_euler("xyz", roll_pitch_yaw).as_matrix(), np.array([tx, ty, alt]))


@given(records)
def test_poses_of_oxts_records_equal_those_of_the_development_kit(rows):
    scale = math.cos(rows[0, 0] * math.pi / 180)
    origin = np.linalg.inv(mercator_pose(rows[0], scale))
    expected = np.stack([origin @ mercator_pose(r, scale) for r in rows])
    assert_allclose(oxts_poses(rows), expected, atol=1e-6)
