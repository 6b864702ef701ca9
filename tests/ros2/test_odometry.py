"""Odometry messages and static transforms."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from modt.geometry import rotation_zyx, se3
from modt.ros2.cdr import MessageError
from modt.ros2.odometry import StaticTransforms, read_odometry, write_odometry
from tests.ros2 import messages

T = se3(rotation_zyx(0.1, -0.2, 2.0), np.array([10.0, -20.0, 0.5]))


@pytest.mark.parametrize("little", [True, False])
def test_a_pose_of_another_implementation_is_read(little):
    quaternion = Rotation.from_matrix(T[:3, :3]).as_quat().tolist()
    message = messages.odometry(3.25, [10.0, -20.0, 0.5], quaternion, "base_link")
    read = read_odometry(messages.encode(message, little=little))
    assert (read.stamp_s, read.child_frame_id) == (3.25, "base_link")
    np.testing.assert_allclose(read.T_odom_child, T, atol=1e-12)


def test_a_written_pose_is_read_by_another_implementation():
    message = messages.decode(write_odometry(3.25, "odom", "lidar", T), "nav_msgs/msg/Odometry")
    assert (message.header.frame_id, message.child_frame_id) == ("odom", "lidar")
    at, turned = message.pose.pose.position, message.pose.pose.orientation
    assert (at.x, at.y, at.z) == (10.0, -20.0, 0.5)
    np.testing.assert_allclose(Rotation.from_quat([turned.x, turned.y, turned.z, turned.w]).as_matrix(), T[:3, :3])


@pytest.mark.parametrize(
    ("position", "quaternion", "reason"),
    [
        ([0.0, np.nan, 0.0], [0.0, 0.0, 0.0, 1.0], "non_finite"),
        ([0.0, 0.0, 0.0], [0.0, 0.0, 0.0, np.inf], "non_finite"),
        ([0.0, 0.0, 0.0], [0.0, 0.0, 0.0, 0.0], "malformed"),
    ],
)
def test_what_is_no_pose_is_refused(position, quaternion, reason):
    with pytest.raises(MessageError) as caught:
        read_odometry(messages.encode(messages.odometry(1.0, position, quaternion)))
    assert caught.value.reason == reason


UP = [0.0, 0.0, 0.0, 1.0]
LEFT = [0.0, 0.0, np.sqrt(0.5), np.sqrt(0.5)]


class TestStaticTransforms:
    def tree(self):
        found = StaticTransforms()
        mount = ("base_link", "mast", [1.0, 0.0, 0.5], LEFT), ("mast", "/lidar", [0.5, 0.0, 1.0], UP)
        found.add(messages.encode(messages.transforms(*mount)))
        found.add(messages.encode(messages.transforms(("base_footprint", "base_link", [0.0, 0.0, 0.2], UP))))
        return found

    def test_frames_are_connected_by_their_ancestors(self):
        np.testing.assert_allclose(self.tree().between("base_link", "lidar")[:3, 3], [1.0, 0.5, 1.5])
        np.testing.assert_allclose(self.tree().between("/base_footprint", "lidar")[:3, 3], [1.0, 0.5, 1.7])
        np.testing.assert_allclose(self.tree().between("lidar", "mast")[:3, 3], [-0.5, 0.0, -1.0])

    def test_what_is_not_connected_has_no_pose(self):
        assert self.tree().between("base_link", "camera") is None

    def test_a_loop_ends(self):
        found = StaticTransforms()
        loop = ("a", "b", [1.0, 0.0, 0.0], UP), ("b", "a", [1.0, 0.0, 0.0], UP)
        found.add(messages.encode(messages.transforms(*loop)))
        assert found.between("a", "c") is None

    def test_a_message_of_another_type_is_refused(self):
        with pytest.raises(MessageError):
            StaticTransforms().add(b"\0\1\0\0\xff\xff\xff\xff")
