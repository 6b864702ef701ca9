"""Attitude of a robot that does not stay level, by poses and by the floor of each sweep."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from modt.geometry import rotation_zyx, se3, transform, yaw_of
from modt.placement import LEVEL, Mount
from modt.sensor_fit.floor_slope import floor_slope
from modt.sensor_fit.levelling import STEADY_SWEEPS, Leveller, untwisted
from modt.types import Frame
from modt_simulation.synthetic_stream import SyntheticStream

SWEEPS = 14


@cache
def walk(gait="6", mount_deg=(0.0, 0.0), sensor="vlp-16", height_m=None):
    stream = SyntheticStream("yard", sensor, 3.0, 5, gait=gait, distort=True, mount_deg=mount_deg, height_m=height_m)
    return tuple(stream.between(0, SWEEPS))


def planar(frame):
    T = frame.T_world_sensor
    return replace(frame, T_world_sensor=se3(rotation_zyx(0.0, 0.0, yaw_of(T)), T[:3, 3]))


def without_pose(frame):
    return replace(frame, T_world_sensor=None)


def in_another_world(frame):
    """The pose in a world whose z axis is not vertical."""
    return replace(frame, T_world_sensor=se3(rotation_zyx(0.2, -0.1, 0.0), np.ones(3)) @ frame.T_world_sensor)


def tilt_left_deg(frame, level):
    """Angle between the vertical and the z axis of the level frame."""
    R = np.eye(3) if level.R_level_sensor is None else level.R_level_sensor
    return float(np.rad2deg(np.arccos(np.clip(R[2] @ frame.T_world_sensor[2, :3], -1.0, 1.0))))


@pytest.mark.parametrize(
    ("given", "most_deg"), [(lambda f: f, 0.5), (planar, 1.0), (without_pose, 1.0), (in_another_world, 2.0)]
)
@pytest.mark.parametrize("mount_deg", [(0.0, 0.0), (9.0, 12.0), (180.0, 0.0)])
def test_sweeps_of_a_walking_robot_are_level_whatever_the_poses(given, most_deg, mount_deg):
    leveller = Leveller(Mount.of(*mount_deg), 0.8, 0.4)
    left_deg = [tilt_left_deg(frame, leveller.level(given(frame))) for frame in walk(mount_deg=mount_deg)]
    swing_deg = [tilt_left_deg(frame, Mount.of(*mount_deg).level(frame)) for frame in walk(mount_deg=mount_deg)]
    assert max(swing_deg) > 5
    assert max(left_deg[3:]) < most_deg


def test_points_keep_their_place_in_the_world_and_the_floor_is_flat():
    leveller = Leveller(LEVEL, 0.8, 0.4)
    for frame in walk():
        level = leveller.level(frame)
        assert len(level.points) == len(frame.points)
        assert_array_equal(level.points[:, 3], frame.points[:, 3])
        R = np.eye(3) if level.R_level_sensor is None else level.R_level_sensor
        assert_allclose(level.T_world_sensor @ se3(R, np.zeros(3)), frame.T_world_sensor, atol=1e-9)
    assert level.T_world_sensor[2, 2] > 0.9999
    x, y, z = level.points.T[:3]
    floor = (np.hypot(x, y) < 9) & (np.abs(z + 0.8) < 0.5)
    assert np.quantile(np.abs(z[floor] - np.median(z[floor])), 0.8) < 0.08


@pytest.mark.parametrize("given", [lambda f: f, without_pose])
def test_a_steady_robot_is_turned_by_its_mount_alone(given):
    mount = Mount.of(0.0, 12.0)
    stream = SyntheticStream("yard", "vlp-16", 1.0, 5, mount_deg=(0.0, 12.0))
    leveller = Leveller(mount, 0.8, 0.4)
    for frame in stream:
        got = leveller.level(given(frame))
        expected = mount.level(given(frame))
        assert got.points.tobytes() == expected.points.tobytes()
        assert_array_equal(leveller.attitude.R_level_sensor, mount.R_level_sensor)
    level = next(iter(SyntheticStream("street", "vlp-16", 0.1, 5)))
    assert Leveller(LEVEL, 0.8, 0.4).level(level) is level


def test_the_mount_is_the_mean_once_the_robot_has_stopped():
    """A mount that was measured in mid-stride is mended by the mean of the strides."""
    wrong = Mount.of(5.0, -5.0)
    leveller = Leveller(wrong, 0.8, 0.4)
    frames = [without_pose(frame) for frame in walk()]
    for frame in frames:
        leveller.level(frame)
    standing = next(iter(SyntheticStream("yard", "vlp-16", 0.1, 5)))
    for k in range(STEADY_SWEEPS + 2):
        level = leveller.level(replace(without_pose(standing), stamp_s=2.0 + 0.1 * k))
    assert tilt_left_deg(standing, wrong.level(standing)) > 5
    assert tilt_left_deg(standing, level) < 2.5


def test_an_unknown_height_is_measured():
    leveller = Leveller(LEVEL, None, 0.4)
    left_deg = [tilt_left_deg(frame, leveller.level(without_pose(frame))) for frame in walk()]
    assert max(left_deg[3:]) < 1.0


def test_without_a_floor_roll_and_pitch_of_the_poses_count_and_else_the_mount():
    leveller = Leveller(LEVEL, 0.8, 0.4)
    bare = Leveller(LEVEL, 0.8, 0.4)
    for k, frame in enumerate(walk()):
        above = frame.points[frame.points[:, 2] > 0.2]
        seen = frame if k < 6 else replace(frame, points=above)
        level = leveller.level(seen)
        alone = bare.level(without_pose(replace(frame, points=above)))
        assert alone.R_level_sensor is None
    assert tilt_left_deg(frame, level) < 1.0


def floor(slope, rate, bend=(0.0, 0.0), n=2000):
    """(3, n) points of a sloping floor, of which a share stands above it, and their (n,) delays [s]."""
    rng = np.random.default_rng(2)
    distance_m = rng.uniform(1.5, 11, n)
    bearing = rng.uniform(-np.pi, np.pi, n)
    x = distance_m * np.cos(bearing)
    y = distance_m * np.sin(bearing)
    delay_s = -bearing * 0.1 / (2 * np.pi)
    x_slope, y_slope = (s + delay_s * (r + delay_s * b) for s, r, b in zip(slope, rate, bend, strict=True))
    z = -0.8 - x_slope * x - y_slope * y
    z += rng.normal(0, 0.01, n) + np.where(rng.random(n) < 0.3, rng.uniform(0.3, 2.0, n), 0.0)
    return np.stack([x, y, z]), delay_s


@pytest.mark.parametrize(
    ("slope_deg", "rate_degps", "bend_degps2"),
    [
        ((0, 0), (0, 0), (0, 0)),
        ((6, -5), (60, 30), (0, 0)),
        ((-14, 9), (-70, 70), (0, 0)),
        ((0.5, 1), (0, -20), (0, 0)),
        ((5, -6), (10, 20), (-450, 400)),
    ],
)
def test_slope_and_its_change_are_measured_in_one_sweep(slope_deg, rate_degps, bend_degps2):
    xyz, delay_s = floor(np.deg2rad(slope_deg), np.deg2rad(rate_degps), np.deg2rad(bend_degps2))
    found = floor_slope(xyz, delay_s, np.zeros(2), 0.8)
    assert_allclose(np.rad2deg(found.slope), slope_deg, atol=0.3)
    assert_allclose(np.rad2deg(found.twist[0]), rate_degps, atol=6.0)
    assert_allclose(np.rad2deg(found.twist[1]), bend_degps2, atol=120.0)
    assert found.depth_m == pytest.approx(0.8, abs=0.03)


def test_where_no_floor_shows_there_is_none():
    rng = np.random.default_rng(3)
    walls = np.stack([np.full(800, 4.0), rng.uniform(-4, 4, 800), rng.uniform(-0.5, 1.5, 800)])
    assert floor_slope(walls, np.zeros(800), np.zeros(2), 0.8) is None
    xyz, delay_s = floor((0.0, 0.0), (0.0, 0.0), n=50)
    assert floor_slope(xyz, delay_s, np.zeros(2), 0.8) is None
    strip = np.stack([rng.uniform(2, 8, 500), rng.uniform(-0.05, 0.05, 500), np.full(500, -0.8)])
    assert floor_slope(strip, np.zeros(500), np.zeros(2), 0.8) is None


def test_untwisted_points_are_as_seen_at_the_stamp():
    rng = np.random.default_rng(4)
    seen = rng.normal(0, 8, (400, 4)).astype(np.float32)
    twist = np.deg2rad([[60.0, -40.0], [300.0, -200.0]])
    delay_s = -np.arctan2(seen[:, 1], seen[:, 0]) * 0.1 / (2 * np.pi)
    back = untwisted(Frame(0, 0.0, seen, turn_s=0.1), twist).points[:, :3]
    for k in range(len(seen)):
        x_slope, y_slope = np.arctan(delay_s[k] * (twist[0] + delay_s[k] * twist[1]))
        # z of the normal falls along x by the slope: the sensor has pitched by -x_slope and rolled by y_slope
        T = se3(rotation_zyx(y_slope, -x_slope, 0.0), np.zeros(3))
        expected = transform(T, seen[k : k + 1, :3].astype(np.float64))[0]
        assert np.linalg.norm(back[k] - expected) < 0.02 * max(1.0, 0.1 * np.linalg.norm(expected))
