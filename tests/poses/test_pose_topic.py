"""Poses of an Odometry topic."""

import numpy as np
import pytest

from modt.config import OdometryConfig
from modt.errors import MisuseError
from modt.geometry import rotation_zyx, se3
from modt.types import Frame
from tests.ros2.network import Scripted

pytest.importorskip("cyclonedds")
from modt.poses import pose_topic
from modt.ros2.odometry import write_odometry
from modt.schemes import open_poses


def frame(stamp_s):
    return Frame(0, stamp_s, np.zeros((1, 4), np.float32))


def pose(stamp_s, x_m, yaw=0.0):
    return write_odometry(stamp_s, "odom", "base_link", se3(rotation_zyx(0, 0, yaw), np.array([x_m, 0.0, 0.0])))


def test_a_frame_has_the_pose_of_the_sensor_at_its_stamp(monkeypatch):
    sent = Scripted([pose(10.0, 3.0), b"\0", pose(10.1, 4.0)], [pose(10.2, 5.0, 0.05)])
    monkeypatch.setattr(pose_topic, "participant", lambda domain: None)
    monkeypatch.setattr(pose_topic, "Subscription", lambda *_, **__: sent)
    topic = open_poses("ros2:///odom?base_to_sensor=1,0,2,0,0,0", OdometryConfig())
    T = topic.place(frame(10.05)).T_world_sensor
    np.testing.assert_allclose(T[:3, 3], [4.5, 0.0, 2.0])
    expected = [5.0 + np.cos(0.05), np.sin(0.05), 2.0]
    np.testing.assert_allclose(topic.place(frame(10.2)).T_world_sensor[:3, 3], expected, atol=1e-9)
    report = topic.report()
    assert (report["received"], report["used"], report["refused"]["malformed"]) == (4, 3, 1)


@pytest.mark.parametrize("mount", ["1,2,3", "1,2,3,4,5,x", "nan,0,0,0,0,0", ""])
def test_a_mount_that_is_no_pose_is_refused(mount):
    with pytest.raises(MisuseError, match=r"x,y,z,roll,pitch,yaw"):
        open_poses(f"ros2:///odom?base_to_sensor={mount}", OdometryConfig())
