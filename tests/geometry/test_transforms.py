"""Rigid transforms, boxes and the field of view."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation

from modt.geometry import (
    Camera,
    FieldOfView,
    corners,
    inverse,
    quaternion_of,
    rotation_of,
    rotation_zyx,
    se3,
    transform,
    transform_boxes,
    turn_between,
    wrap,
    yaw_of,
)

angle = st.floats(-10, 10)
metre = st.floats(-100, 100)
planar = st.builds(lambda y, t: se3(rotation_zyx(0, 0, y), np.array(t)), angle, st.tuples(metre, metre, metre))
boxes = arrays(np.float64, (3, 7), elements=st.floats(0.1, 20))


turns = st.lists(st.floats(-1, 1), min_size=4, max_size=4).map(np.array).filter(lambda q: np.linalg.norm(q) > 0.01)
"""Rotations, as quaternions of any length."""
half_turns = st.sampled_from([np.eye(4)[i] for i in range(4)])


@given(turns | half_turns)
def test_quaternions_are_those_of_scipy(quaternion):
    R = Rotation.from_quat(quaternion).as_matrix()
    assert_allclose(rotation_of(quaternion), R, atol=1e-12)
    found = quaternion_of(se3(R, np.zeros(3)))
    expected = quaternion / np.linalg.norm(quaternion)
    assert_allclose(found * np.sign(found @ expected), expected, atol=1e-7)


@given(turns, turns | half_turns, st.floats(-2, 2))
def test_a_share_of_a_turn_is_that_of_its_rotation_vector(q, turn, share):
    a = Rotation.from_quat(q)
    rotation = Rotation.from_quat(turn)
    part = Rotation.from_rotvec(share * rotation.as_rotvec())
    if rotation.magnitude() > np.pi - 1e-3:  # either way round
        return
    found = turn_between(se3(a.as_matrix(), np.ones(3)), se3((a * rotation).as_matrix(), np.ones(3)), share)
    assert_allclose(found, (a * part).as_matrix(), atol=1e-6)


@given(angle)
def test_wrapped_angles_keep_their_direction(a):
    w = float(wrap(np.array(a)))
    assert -np.pi <= w < np.pi
    assert np.allclose([np.cos(w), np.sin(w)], [np.cos(a), np.sin(a)])


@given(angle, angle, angle, st.tuples(metre, metre, metre))
def test_angles_of_a_transform_are_those_of_scipy_and_its_inverse_undoes_it(roll, pitch, yaw, position):
    T = se3(rotation_zyx(roll, pitch, yaw), np.array(position))
    assert_allclose(T[:3, :3], Rotation.from_euler("ZYX", [yaw, pitch, roll]).as_matrix(), atol=1e-9)
    assert_allclose(T @ inverse(T), np.eye(4), atol=1e-9)
    assert_allclose(wrap(yaw_of(se3(rotation_zyx(roll, 0.1, yaw), np.zeros(3))) - yaw), 0.0, atol=1e-9)


@given(planar, boxes)
def test_corners_of_a_moved_box_are_the_moved_corners(T, box):
    before = np.concatenate([corners(box), np.repeat(box[:, None, 2:3], 4, axis=1)], axis=2)
    moved = transform(T, before.reshape(-1, 3)).reshape(3, 4, 3)[..., :2]
    assert np.allclose(corners(transform_boxes(T, box)), moved, atol=1e-6)


@given(boxes)
def test_corners_enclose_length_times_width(box):
    x, y = np.moveaxis(corners(box), 2, 0)
    area = 0.5 * np.abs((x * np.roll(y, -1, axis=1) - y * np.roll(x, -1, axis=1)).sum(axis=1))
    assert np.allclose(area, box[:, 3] * box[:, 4])


def forward_camera() -> Camera:
    """100 pixels of focal length, 200 wide: 45 degrees to each side."""
    T = np.array([[0.0, -1, 0, 0], [0, 0, -1, 0], [1, 0, 0, 0], [0, 0, 0, 1]])
    K = np.array([[100.0, 0, 100, 0], [0, 100, 50, 0], [0, 0, 1, 0]])
    return Camera(K @ T, T, 200, 100)


def test_field_of_view_of_a_camera_is_its_wedge():
    fov = FieldOfView.of_camera(forward_camera())
    xyz = np.array([[10, 0, 0], [10, 9.9, 0], [10, 10.1, 0], [10, -9.9, 5], [10, -10.1, 5], [-10, 0, 0]])
    assert (fov.depth(xyz) > 0).tolist() == [True, True, False, True, False, False]
    assert np.isclose(fov.depth(xyz)[0], 10 / np.sqrt(2))


@given(arrays(np.float32, (5, 4), elements=st.floats(-50, 50, width=32)))
def test_full_circle_contains_everything(points):
    assert (FieldOfView().depth(points) > 0).all()
    assert FieldOfView().full
