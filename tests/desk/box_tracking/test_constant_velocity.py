"""The filter in three numbers against the textbook's matrices."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from modt_desk.box_tracking import box_tracker

STATES = arrays(np.float64, (3, 4), elements=st.floats(-50, 50, allow_subnormal=False))
PLACES = arrays(np.float64, (3, 2), elements=st.floats(-50, 50, allow_subnormal=False))
FACTORS = arrays(np.float64, (3, 2, 2), elements=st.floats(-2, 2, allow_subnormal=False))
VARIANCES = arrays(np.float64, 3, elements=st.floats(0.01, 4))


def packed_covariance(factors):
    P = factors @ factors.transpose(0, 2, 1) + 0.01 * np.eye(2)
    return np.stack([P[:, 0, 0], P[:, 0, 1], P[:, 1, 1]], axis=1)


def full_covariance(P):
    """(4, 4) covariance of x, y, vx, vy."""
    return np.kron([[P[0], P[1]], [P[1], P[2]]], np.eye(2))


@given(STATES, FACTORS, st.floats(0, 2), st.floats(0.1, 20))
def test_prediction_equals_the_full_kalman_filter(x, factors, dt_s, acceleration):
    P = packed_covariance(factors)
    moved, grown = box_tracker.predict(x, P, acceleration, dt_s)
    F = np.kron([[1, dt_s], [0, 1]], np.eye(2))
    push = acceleration * np.kron([[dt_s**2 / 2], [dt_s]], np.eye(2))
    for i in range(len(x)):
        np.testing.assert_allclose(moved[i], F @ x[i], atol=1e-9)
        np.testing.assert_allclose(
            full_covariance(grown[i]), F @ full_covariance(P[i]) @ F.T + push @ push.T, atol=1e-9
        )


@given(STATES, FACTORS, PLACES, VARIANCES)
def test_update_equals_the_full_kalman_filter(x, factors, z, variance):
    P = packed_covariance(factors)
    after, squeezed = box_tracker.update(x, P, z, variance)
    H = np.eye(2, 4)
    for i in range(len(x)):
        K = full_covariance(P[i]) @ H.T @ np.linalg.inv(H @ full_covariance(P[i]) @ H.T + variance[i] * np.eye(2))
        np.testing.assert_allclose(after[i], x[i] + K @ (z[i] - H @ x[i]), atol=1e-7)
        np.testing.assert_allclose(
            full_covariance(squeezed[i]), (np.eye(4) - K @ H) @ full_covariance(P[i]), atol=1e-9
        )
