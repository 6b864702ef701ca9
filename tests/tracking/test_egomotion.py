import numpy as np

from modt.config import TrackingConfig
from modt.geometry import inverse, rotation_zyx, se3, transform_boxes, yaw_of
from modt.tracking.states import EFFICIENT
from modt.tracking.tracker import Tracker, rigid

from .tracking_scenes import frame_of


def street(seed=0, n=40):
    rng = np.random.default_rng(seed)
    place = rng.uniform([-20, -25], [60, 25], (n, 2))
    size = rng.uniform(0.3, 2.0, (n, 2))
    return np.c_[place, np.full(n, -1.0), size.max(axis=1), size.min(axis=1), np.full(n, 1.5), rng.uniform(-3, 3, n)]


def drive(i):
    yaw = 0.008 * i
    return se3(rotation_zyx(0, 0, yaw), np.array([0.8 * i, 0.003 * i * i, 0.0]))


def follow(n, moving=0, posed=False):
    tracker = Tracker(TrackingConfig(), EFFICIENT)
    world = street()
    for i in range(n):
        now = world.copy()
        now[:moving, 0] += 1.2 * i
        T = drive(i)
        tracker.follow(*frame_of(transform_boxes(inverse(T), now), i, T if posed else None, points=150))
    return tracker


def test_the_sensors_way_is_found_among_what_stands():
    tracker = follow(30)
    error = inverse(drive(29)) @ tracker.T_world_sensor
    assert np.hypot(*error[:2, 3]) < 0.02 * 0.8 * 29
    assert abs(np.rad2deg(yaw_of(error))) < 0.3
    assert len(tracker.tracks) == 40


def test_a_third_that_moves_does_not_mislead():
    tracker = follow(20, moving=13)
    error = inverse(drive(19)) @ tracker.T_world_sensor
    assert np.hypot(*error[:2, 3]) < 0.03 * 0.8 * 19
    assert abs(np.rad2deg(yaw_of(error))) < 0.5


def test_a_pose_that_is_given_is_taken():
    np.testing.assert_array_equal(follow(3, posed=True).T_world_sensor, drive(2))


def test_odometry_that_fails_for_a_while_is_bridged():
    tracker, world = Tracker(TrackingConfig(), EFFICIENT), street()
    for i in range(20):
        T = drive(i)
        frame = frame_of(transform_boxes(inverse(T), world), i, None if 8 <= i < 14 else T, points=150)
        tracker.follow(*frame)
    assert len(tracker.tracks) == 40
    assert tracker.tracks.age.min() == 20


def test_odometry_that_begins_late_finds_the_tracks_where_they_are():
    tracker, world = Tracker(TrackingConfig(), EFFICIENT), street()
    T_elsewhere = se3(rotation_zyx(0, 0, 2.0), np.array([400.0, -90.0, 0.0]))
    for i in range(20):
        T = None if i < 6 or i in (12, 13) else T_elsewhere @ drive(i)
        tracker.follow(*frame_of(transform_boxes(inverse(drive(i)), world), i, T, points=150))
    assert len(tracker.tracks) == 40
    assert tracker.tracks.age.min() == 20
    np.testing.assert_allclose(tracker.T_world_sensor, drive(19), atol=0.15)


def test_a_first_pose_far_from_the_origin_is_no_motion():
    tracker, world = Tracker(TrackingConfig(), EFFICIENT), street()
    T_elsewhere = se3(rotation_zyx(0, 0, 2.0), np.array([400.0, -90.0, 0.0]))
    for i in range(4):
        T = T_elsewhere @ drive(0) if i == 0 else None
        tracker.follow(*frame_of(transform_boxes(inverse(drive(i)), world), i, T, points=150))
    assert len(tracker.tracks) == 40
    np.testing.assert_allclose(tracker.T_world_sensor, T_elsewhere @ drive(3), atol=0.15)


def test_without_landmarks_the_sensor_goes_on_as_it_went():
    tracker = follow(10)
    before = tracker.T_world_sensor.copy()
    tracker.follow(*frame_of([], 10, None))
    step = inverse(before) @ tracker.T_world_sensor
    np.testing.assert_allclose(step, inverse(drive(8)) @ drive(9), atol=0.05)


def test_products_of_poses_stay_rigid():
    T = drive(3)
    T[:3, :3] *= 1.01
    R = rigid(T)[:3, :3]
    np.testing.assert_allclose(R @ R.T, np.eye(3), atol=1e-12)
