import numpy as np
import pytest

from modt.viewer.sensor_pose import sensor_pose


@pytest.mark.parametrize("pose", [(0, 0, 0), (3.5, -70, 2.9), (-8, 4, -3.1)])
def test_pose_is_found_among_tracks_that_lag(pose):
    random = np.random.default_rng(1)
    sensor = random.uniform(-40, 40, (60, 2))
    x, y, yaw = pose
    turn = np.array([[np.cos(yaw), -np.sin(yaw)], [np.sin(yaw), np.cos(yaw)]])
    world = sensor @ turn.T + [x, y] + random.normal(0, 0.02, (60, 2))
    world[:12] += 4.0
    np.testing.assert_allclose(sensor_pose(sensor, world, np.zeros(3)), pose, atol=0.02)


def test_one_track_says_nothing():
    before = np.array([1.0, 2.0, 0.3])
    np.testing.assert_array_equal(sensor_pose(np.ones((1, 2)), np.zeros((1, 2)), before), before)
