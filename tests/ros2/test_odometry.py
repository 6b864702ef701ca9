"""Odometry messages and static transforms."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation

from modt.geometry import rotation_zyx, se3
from modt.ros2.odometry import Transforms, read_odometry, write_odometry
from tests.ros2 import messages

T = se3(rotation_zyx(0.1, -0.2, 2.0), np.array([10.0, -20.0, 0.5]))


@pytest.mark.parametrize("little", [True, False])
def test_a_pose_of_another_implementation_is_read(little):
    quaternion = Rotation.from_matrix(T[:3, :3]).as_quat().tolist()
    message = messages.odometry(3.25, [10.0, -20.0, 0.5], quaternion, "base_link")
    read = read_odometry(messages.encode(message, little=little))
    assert (read.stamp_s, read.child_frame_id) == (3.25, "base_link")
    assert_allclose(read.T_odom_child, T, atol=1e-12)


def test_a_written_pose_is_read_by_another_implementation():
    message = messages.decode(write_odometry(3.25, "odom", "lidar", T), "nav_msgs/msg/Odometry")
    assert (message.header.frame_id, message.child_frame_id) == ("odom", "lidar")
    at = message.pose.pose.position
    turned = message.pose.pose.orientation
    assert (at.x, at.y, at.z) == (10.0, -20.0, 0.5)
    assert_allclose(Rotation.from_quat([turned.x, turned.y, turned.z, turned.w]).as_matrix(), T[:3, :3])


UP = [0.0, 0.0, 0.0, 1.0]
LEFT = [0.0, 0.0, np.sqrt(0.5), np.sqrt(0.5)]


def tree_of(*messages_of_edges):
    found = Transforms()
    for edges in messages_of_edges:
        found.add(messages.encode(messages.transforms(*edges)))
    return found


def test_static_transforms_connect_frames_by_their_ancestors():
    mount = ("base_link", "mast", [1.0, 0.0, 0.5], LEFT), ("mast", "/lidar", [0.5, 0.0, 1.0], UP)
    tree = tree_of(mount, [("base_footprint", "base_link", [0.0, 0.0, 0.2], UP)])
    assert_allclose(tree.between("base_link", "lidar")[:3, 3], [1.0, 0.5, 1.5])
    assert_allclose(tree.between("/base_footprint", "lidar")[:3, 3], [1.0, 0.5, 1.7])
    assert_allclose(tree.between("lidar", "mast")[:3, 3], [-0.5, 0.0, -1.0])
    assert tree.between("base_link", "camera") is None


def test_a_loop_of_static_transforms_ends():
    loop = ("a", "b", [1.0, 0.0, 0.0], UP), ("b", "a", [1.0, 0.0, 0.0], UP)
    assert tree_of(loop).between("a", "c") is None


def test_a_transform_that_is_none_drops_no_other():
    good = ("base_link", "lidar", [1.0, 0.0, 0.5], UP)
    for bad in (("base_link", "camera", [np.nan, 0.0, 0.0], UP), ("base_link", "imu", [0.0, 0.0, 0.0], [0.0] * 4)):
        tree = tree_of([bad, good])
        assert_allclose(tree.between("base_link", "lidar")[:3, 3], [1.0, 0.0, 0.5])


def test_a_transform_that_moves_is_no_mount():
    tree = tree_of([("base_link", "arm", [0.0, 0.0, 0.0], UP)], [("base_link", "arm", [0.1, 0.0, 0.0], UP)])
    assert tree.between("base_link", "arm") is None
    assert tree.moves("arm")
