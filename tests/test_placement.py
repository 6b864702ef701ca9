"""The mount of a sensor: frames and cameras turned level."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from modt.app import assembly
from modt.geometry import FieldOfView, inverse, quaternion_of, rotation_zyx, se3, transform
from modt.placement import LEVEL, Mount
from modt.profile import load, parse
from modt.sinks.poses import box_poses, in_sensor_frame
from modt.types import NONE, Frame
from modt_simulation.synthetic_stream import CAMERA, SyntheticStream

TILTED = Mount.of(10.0, -5.0)
R = rotation_zyx(*np.deg2rad([10.0, -5.0, 0.0]))
POINTS = np.random.default_rng(0).normal(0, 10, (50, 4)).astype(np.float32)


def test_a_level_mount_gives_the_frame_itself():
    frame = Frame(0, 0.0, POINTS, np.eye(4))
    assert Mount.of(None, None) == Mount.of(0.0, 0.0) == LEVEL
    assert LEVEL.level(frame) is frame
    assert LEVEL.camera(CAMERA) is CAMERA


def test_points_stay_where_they_are_in_the_world_and_in_the_image():
    pose = se3(rotation_zyx(0.1, 0.2, 0.3), np.array([1.0, 2.0, 3.0]))
    frame = Frame(0, 0.0, POINTS, pose, turn_s=0.1)
    level = TILTED.level(frame)
    assert_allclose(level.points[:, :3], POINTS[:, :3] @ R.T, atol=1e-5)
    assert_array_equal(level.points[:, 3], POINTS[:, 3])
    seen, turned = (transform(f.T_world_sensor, f.points[:, :3].astype(np.float64)) for f in (frame, level))
    assert_allclose(seen, turned, atol=1e-4)
    assert level.turn_s == 0.1
    camera = TILTED.camera(CAMERA)
    rows = np.ones((50, 4))
    images = []
    for points, of in ((frame.points, CAMERA), (level.points, camera)):
        rows[:, :3] = points[:, :3]
        images.append(rows @ of.P_image_sensor.T)
    assert_allclose(*images, rtol=1e-4, atol=1e-2)


def test_the_head_of_a_sensor_upside_down_turns_the_other_way():
    assert Mount.of(180.0, 0.0).level(Frame(0, 0.0, POINTS, turn_s=0.1)).turn_s == -0.1


def test_poses_of_ros_2_are_in_the_frame_of_the_tilted_sensor():
    poses = box_poses(np.array([[5.0, 1.0, -0.5, 1.0, 1.0, 1.0, 0.3]]))
    assert in_sensor_frame(poses, None) is poses
    turned = in_sensor_frame(poses, R)
    assert_allclose(turned[0, :3], R.T @ poses[0, :3])
    expected = quaternion_of(se3(R.T @ rotation_zyx(0.0, 0.0, 0.3), np.zeros(3)))
    assert abs(turned[0, 3:] @ expected) == pytest.approx(1.0)


def test_a_tilted_sensor_gives_the_tracks_of_a_level_one():
    """Turning the sweeps of a level sensor, and stating it, changes nothing but the last digits."""
    results = []
    for text, mount in (
        ("sensor: {elevation_span_deg: null}\nextends: vlp-16", LEVEL),
        ("sensor: {roll_deg: 10, pitch_deg: -5, elevation_span_deg: null}\nextends: vlp-16", TILTED),
    ):
        profile, mode = parse(text, "test"), assembly.MODES["accurate"]
        pipeline = assembly.pipeline(mode, profile, FieldOfView())
        back = Mount(None if mount.R_level_sensor is None else mount.R_level_sensor.T)
        for frame in SyntheticStream("yard", "vlp-16", 0.5, seed=4):
            result = pipeline.step(back.level(frame))
        results.append(result)
    level, tilted = results
    assert len(level.proposals) == len(tilted.proposals)
    assert level.tracks.id.tolist() == tilted.tracks.id.tolist()
    assert_allclose(level.T_world_sensor, tilted.T_world_sensor, atol=1e-9)
    seen = level.tracks.proposal != NONE
    assert_allclose(level.tracks.box[seen], tilted.tracks.box[seen], atol=0.02)
    assert_allclose(tilted.T_world_sensor @ inverse(level.T_world_sensor), np.eye(4), atol=1e-9)
    assert load("vlp-16").sensor.roll_deg is None
