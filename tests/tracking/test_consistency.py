"""The filter says how wrong it is."""

import numpy as np
import pytest
from scipy.stats import chi2

from modt.tracking import kalman

RUNS, STEPS, DT_S = 400, 40, 0.1
ACCELERATION, TURN, SIGMA = 1.5, 0.2, 0.1


def normalised(error, P):
    """Squared, by the covariances."""
    return np.einsum("in,nij,jn->n", error, np.linalg.inv(P.transpose(2, 0, 1)), error)


@pytest.mark.parametrize("speed", [3.0, 12.0])
def test_normalised_errors_are_as_large_as_they_should_be(speed):
    """NEES over many lives of objects that move as the model says, begun from one observation at rest."""
    rng = np.random.default_rng(1)
    truth = np.array([*rng.uniform(-20, 20, (2, RUNS)), rng.uniform(-np.pi, np.pi, RUNS), np.full(RUNS, speed)])
    x = np.zeros((4, RUNS))
    x[:2] = truth[:2] + rng.normal(0, SIGMA, (2, RUNS))
    P = np.diag([SIGMA**2, SIGMA**2, np.pi**2, 10.0**2])[:, :, None].repeat(RUNS, axis=2)
    R = SIGMA**2 * np.eye(2)[:, :, None].repeat(RUNS, axis=2)
    place, all_ = [], []
    for step in range(STEPS):
        truth = kalman.motion(truth, DT_S)
        truth[2] += rng.normal(0, TURN * DT_S, RUNS)
        truth[3] += rng.normal(0, ACCELERATION * DT_S, RUNS)
        x, P = kalman.predict(x, P, DT_S, ACCELERATION, TURN)
        z = truth[:2] + rng.normal(0, SIGMA, (2, RUNS))
        slow = np.abs(x[3]) < np.sqrt(P[3, 3])
        course = np.where(slow, np.arctan2(z[1] - x[1], z[0] - x[0]), x[2])
        x, P = kalman.turn_about(*kalman.update(*kalman.face(x, P, course), z, R))
        if step >= STEPS // 2:
            error = x - truth
            error[2] = np.angle(np.exp(1j * error[2]))
            place.append(normalised(error[:2], P[:2, :2]))
            all_.append(normalised(error, P))
    assert 0.7 * 2 < np.mean(place) < 1.3 * 2
    assert 0.6 * 4 < np.median(all_) / chi2(4).median() * 4 < 1.4 * 4
