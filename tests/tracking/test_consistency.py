"""The filter says how wrong it is."""

import numpy as np
import pytest
from scipy.stats import chi2

from modt.tracking import kalman

RUNS, STEPS, DT_S = 400, 40, 0.1
ACCELERATION, TURN, SIGMA = 1.5, 0.2, 0.1


@pytest.mark.parametrize("speed", [3.0, 12.0])
def test_normalised_errors_are_as_large_as_they_should_be(speed):
    """NEES over many lives of objects that move as the model says, begun from one observation at rest."""
    rng = np.random.default_rng(1)
    truth = np.c_[rng.uniform(-20, 20, (RUNS, 2)), rng.uniform(-np.pi, np.pi, RUNS), np.full(RUNS, speed)]
    x = np.zeros((RUNS, 4))
    x[:, :2] = truth[:, :2] + rng.normal(0, SIGMA, (RUNS, 2))
    P = np.broadcast_to(np.diag([SIGMA**2, SIGMA**2, np.pi**2, 10.0**2]), (RUNS, 4, 4)).copy()
    R = np.broadcast_to(np.eye(2) * SIGMA**2, (RUNS, 2, 2))
    a, w = np.full(RUNS, ACCELERATION), np.full(RUNS, TURN)
    place, all_ = [], []
    for step in range(STEPS):
        truth = kalman.motion(truth, DT_S)
        truth[:, 2] += rng.normal(0, TURN * DT_S, RUNS)
        truth[:, 3] += rng.normal(0, ACCELERATION * DT_S, RUNS)
        x, P = kalman.predict(x, P, kalman.process_noise(x, DT_S, a, w), DT_S)
        z = truth[:, :2] + rng.normal(0, SIGMA, (RUNS, 2))
        slow = np.abs(x[:, 3]) < np.sqrt(P[:, 3, 3])
        course = np.where(slow, np.arctan2(z[:, 1] - x[:, 1], z[:, 0] - x[:, 0]), x[:, 2])
        x, P = kalman.turn_about(*kalman.update(*kalman.face(x, P, course), z, R))
        if step >= STEPS // 2:
            error = x - truth
            error[:, 2] = np.angle(np.exp(1j * error[:, 2]))
            place.append(np.einsum("ni,nij,nj->n", error[:, :2], np.linalg.inv(P[:, :2, :2]), error[:, :2]))
            all_.append(np.einsum("ni,nij,nj->n", error, np.linalg.inv(P), error))
    assert 0.7 * 2 < np.mean(place) < 1.3 * 2
    assert 0.6 * 4 < np.median(all_) / chi2(4).median() * 4 < 1.4 * 4


def test_a_walk_straight_ahead_is_known_after_a_second():
    x, P = np.zeros((1, 4)), np.diag([0.01, 0.01, np.pi**2, 25.0])[None]
    ones = np.ones(1)
    for i in range(1, 11):
        z = np.array([[0.0, -0.14 * i]])
        x, P = kalman.predict(x, P, kalman.process_noise(x, DT_S, ones, 0.3 * ones), DT_S)
        x, P = kalman.face(x, P, np.arctan2(z[:, 1] - x[:, 1], z[:, 0] - x[:, 0])) if i == 1 else (x, P)
        x, P = kalman.turn_about(*kalman.update(x, P, z, 0.01 * np.eye(2)[None]))
    np.testing.assert_allclose(x[0, 2:], [-np.pi / 2, 1.4], atol=0.15)
