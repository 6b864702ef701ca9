"""Poses from OXTS records against the formulas of the development kit."""

import math

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from modt.sources.kitti_calibration import oxts_poses

small = st.floats(-1e-3, 1e-3)
records = arrays(np.float64, (4, 6), elements=small).map(lambda a: a + np.array([49.0, 8.4, 110.0, 0.01, 0.02, 1.0]))


def mercator_pose(record, scale):
    lat, lon, alt, roll, pitch, yaw = record
    er = 6378137.0
    tx = scale * lon * math.pi * er / 180
    ty = scale * er * math.log(math.tan((90 + lat) * math.pi / 360))
    rx = np.array([[1, 0, 0], [0, math.cos(roll), -math.sin(roll)], [0, math.sin(roll), math.cos(roll)]])
    ry = np.array([[math.cos(pitch), 0, math.sin(pitch)], [0, 1, 0], [-math.sin(pitch), 0, math.cos(pitch)]])
    rz = np.array([[math.cos(yaw), -math.sin(yaw), 0], [math.sin(yaw), math.cos(yaw), 0], [0, 0, 1]])
    T = np.eye(4)
    T[:3, :3] = rz @ ry @ rx
    T[:3, 3] = tx, ty, alt
    return T


@given(records)
def test_poses_equal_those_of_the_development_kit(rows):
    scale = math.cos(rows[0, 0] * math.pi / 180)
    origin = np.linalg.inv(mercator_pose(rows[0], scale))
    expected = np.stack([origin @ mercator_pose(r, scale) for r in rows])
    np.testing.assert_allclose(oxts_poses(rows), expected, atol=1e-6)
