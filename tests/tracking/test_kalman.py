import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from numpy.testing import assert_allclose

from modt.geometry import wrap
from modt.tracking import kalman

STATES = arrays(np.float64, (4, 3), elements=st.floats(-3, 3, allow_subnormal=False))
POSITIVE = arrays(np.float64, (3, 4, 4), elements=st.floats(-1, 1, allow_subnormal=False)).map(
    lambda A: (A @ A.transpose(0, 2, 1) + 0.1 * np.eye(4)).transpose(1, 2, 0)
)


def eigenvalues(P):
    return np.linalg.eigvalsh(P.transpose(2, 0, 1))


def motion(x, dt_s):
    """States (4, M) dt_s later at constant heading and speed (Equation 1)."""
    step = dt_s * x[3] * np.array([np.cos(x[2]), np.sin(x[2])])
    return np.concatenate([x[:2] + step, x[2:]])


def slow_predict(x, P, dt_s, acceleration, turn):
    """Textbook form, one track at a time."""
    c = np.cos(x[2])
    s = np.sin(x[2])
    F = np.eye(4)
    F[:2, 2:] = [[-dt_s * s * x[3], dt_s * c], [dt_s * c * x[3], dt_s * s]]
    Q = np.diag([(dt_s**2 / 2 * acceleration) ** 2] * 2 + [(dt_s * turn) ** 2, (dt_s * acceleration) ** 2])
    Q[:2, 3] = Q[3, :2] = dt_s**3 / 2 * acceleration**2 * np.array([c, s])
    return x + dt_s * x[3] * np.array([c, s, 0, 0]), F @ P @ F.T + Q


def slow_update(x, P, z, R):
    """Textbook form, one track at a time."""
    H = np.eye(2, 4)
    S = H @ P @ H.T + R
    K = P @ H.T @ np.linalg.inv(S)
    after = x + K @ (z - H @ x)
    after[2] = wrap(after[2])
    return after, (np.eye(4) - K @ H) @ P


@given(STATES, POSITIVE, st.floats(0, 1))
def test_prediction_is_the_textbooks(x, P, dt_s):
    acceleration = np.array([0.5, 1.0, 2.0])
    turn = np.array([0.1, 0.2, 0.3])
    after, covariance = kalman.predict(x, P, dt_s, acceleration, turn)
    for i in range(3):
        slow_x, slow_P = slow_predict(x[:, i], P[:, :, i], dt_s, acceleration[i], turn[i])
        assert_allclose(after[:, i], slow_x, atol=1e-9)
        assert_allclose(covariance[:, :, i], slow_P, atol=1e-9)


@given(STATES, POSITIVE, arrays(np.float64, (2, 3), elements=st.floats(-5, 5)))
def test_update_is_the_textbooks(x, P, z):
    R = np.diag([0.2, 0.3])[:, :, None].repeat(3, axis=2)
    after, covariance = kalman.update(x, P, z, R)
    for i in range(3):
        slow_x, slow_P = slow_update(x[:, i], P[:, :, i], z[:, i], R[:, :, i])
        assert_allclose(np.delete(after[:, i], 2), np.delete(slow_x, 2), atol=1e-8)
        assert abs(wrap(after[2, i] - slow_x[2])) < 1e-8
        assert_allclose(covariance[:, :, i], slow_P, atol=1e-8)


@given(STATES, POSITIVE, st.floats(0, 0.5))
def test_covariances_stay_covariances(x, P, dt_s):
    x, P = kalman.predict(x, P, dt_s, 2.0, 0.3)
    x, P = kalman.update(x, P, x[:2] + 0.1, np.eye(2)[:, :, None].repeat(3, axis=2))
    assert_allclose(P, P.transpose(1, 0, 2), atol=1e-9)
    assert eigenvalues(P).min() > -1e-9


@given(STATES, POSITIVE, arrays(np.float64, 3, elements=st.floats(-3, 3)))
def test_turning_a_standing_track_moves_nothing(x, P, heading):
    x[3] = 0
    turned, Q = kalman.with_heading(x, P, heading)
    assert_allclose(motion(turned, 0.1), motion(x, 0.1) + (turned - x), atol=1e-12)
    assert_allclose(eigenvalues(Q), eigenvalues(P), atol=1e-9)
    assert_allclose(np.hypot(Q[0, 3], Q[1, 3]), np.hypot(P[0, 3], P[1, 3]))


@given(STATES, POSITIVE)
def test_turning_about_keeps_the_motion(x, P):
    turned, Q = kalman.with_forward_speed(x, P)
    assert_allclose(eigenvalues(Q), eigenvalues(P), atol=1e-9)
    assert (turned[3] >= 0).all()
    assert_allclose(motion(turned, 1.0)[:2], motion(x, 1.0)[:2], atol=1e-12)
