import numpy as np

from modt.geometry import rotation_zyx, se3
from modt.viewer.track_rows import planar


def test_a_planar_pose_is_position_and_yaw():
    T = se3(rotation_zyx(0.05, -0.03, 2.9), np.array([3.5, -70.0, 1.0]))
    np.testing.assert_allclose(planar(T), [3.5, -70.0, 2.9], atol=1e-12)
