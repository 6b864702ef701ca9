"""Poses of an Odometry topic."""

import numpy as np
import pytest

from modt.config import OdometryConfig
from modt.errors import MisuseError
from modt.geometry import rotation_zyx, se3
from modt.types import Frame
from tests.ros2.network import FAR, NEAR, Scripted, until

pytest.importorskip("cyclonedds")
from modt.ros2 import dds, odometry
from modt.ros2.odometry import write_odometry
from modt.schemes import open_poses
from modt.sources.pose_topic import PoseTopic


def frame(stamp_s):
    return Frame(0, stamp_s, np.zeros((1, 4), np.float32))


def pose(stamp_s, x_m, yaw=0.0):
    return write_odometry(stamp_s, "odom", "base_link", se3(rotation_zyx(0, 0, yaw), np.array([x_m, 0.0, 0.0])))


def test_a_frame_has_the_pose_of_the_sensor_at_its_stamp():
    held = Scripted([pose(10.0, 3.0), pose(10.1, 4.0)], [pose(10.2, 5.0, 0.05)])
    topic = PoseTopic(held, OdometryConfig(), "odom", se3(np.eye(3), np.array([1.0, 0.0, 2.0])))
    T = topic.place(frame(10.05)).T_world_sensor
    np.testing.assert_allclose(T[:3, 3], [4.5, 0.0, 2.0])
    expected = [5.0 + np.cos(0.05), np.sin(0.05), 2.0]
    np.testing.assert_allclose(topic.place(frame(10.2)).T_world_sensor[:3, 3], expected, atol=1e-9)
    assert topic.report()["used"] == 3


def test_unusable_poses_are_counted_by_their_reason():
    bad = [pose(10.0, 3.0), pose(9.0, 3.0), pose(10.02, np.nan), pose(10.03, 1e9), b"\0"]
    topic = PoseTopic(Scripted([pose(10.0, 3.0), *bad]), OdometryConfig(), "odom", np.eye(4))
    assert topic.place(frame(10.0)).T_world_sensor is not None
    report = topic.report()
    assert (report["received"], report["used"]) == (6, 1)
    counts = {reason: count for reason, count in report["refused"].items() if count}
    assert counts == {"repeated": 1, "stale": 1, "non_finite": 1, "malformed": 2}


def test_poses_over_loopback(loopback):
    address = f"ros2:///odom?domain={NEAR}&base_to_sensor=0,0,1.5,0,0,0"
    topic = open_poses(address, OdometryConfig())
    sent = dds.Publication(dds.participant(FAR), "odom", odometry.TYPE)
    until(lambda: sent.receivers and topic._subscription.senders)
    sent.write(pose(10.0, 3.0))
    until(lambda: topic.place(frame(10.0)).T_world_sensor is not None)
    np.testing.assert_allclose(topic.place(frame(10.0)).T_world_sensor[:3, 3], [3.0, 0.0, 1.5])
    assert topic.report()["source"] == address
    topic.close()


@pytest.mark.parametrize("mount", ["1,2,3", "1,2,3,4,5,x", "nan,0,0,0,0,0", ""])
def test_a_mount_that_is_no_pose_is_refused(mount):
    with pytest.raises(MisuseError, match=r"x,y,z,roll,pitch,yaw"):
        open_poses(f"ros2:///odom?base_to_sensor={mount}", OdometryConfig())
