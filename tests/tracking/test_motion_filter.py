"""The filter of two hypotheses: what rests reads no velocity, starts and stops are seen, covariances are true."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from modt.geometry.kernels import NUMPY_GEOMETRY
from modt.tracking.motion_filter import motion_filter_of
from modt.tracking.track_table import TrackTable
from modt.tracking.tuning import MotionFilterTuning

PERIOD_S = 0.1
SIGMA_M = 0.05
NOISE = SIGMA_M**2 * np.eye(2)[None]
TUNING = MotionFilterTuning()


def begun(position, kernels=NUMPY_GEOMETRY):
    """A filter, and a table of new tracks at positions (M, 2)."""
    subject = motion_filter_of(kernels, TUNING)
    tracks = TrackTable.blank(len(position))
    subject.begin(tracks, slice(0, None), np.asarray(position, np.float64))
    return subject, tracks


def step(subject, tracks, position, dt_s=PERIOD_S):
    """Filter positions (M, 2) dt_s later."""
    rows = np.arange(len(tracks))
    subject.predict(tracks, dt_s)
    noise = NOISE.repeat(len(rows), axis=0)
    subject.believe(tracks, rows, subject.update(tracks, rows, np.asarray(position, np.float64), noise))


def followed(positions, seed=0):
    """Probability of moving (K,) and velocity (K, 2) of a track at positions (K, 2) that are measured with noise."""
    measured = np.asarray(positions) + np.random.default_rng(seed).normal(0, 0.6 * SIGMA_M, (len(positions), 2))
    subject, tracks = begun(measured[:1])
    found = []
    for position in measured[1:]:
        step(subject, tracks, position[None])
        found.append((tracks.moving_probability[0], tracks.velocity[0].copy()))
    probability, velocity = zip(*found, strict=True)
    return np.array(probability), np.array(velocity)


@pytest.mark.parametrize("seed", range(5))
def test_what_rests_reads_no_velocity(seed):
    probability, velocity = followed(np.full((40, 2), 7.0), seed)
    assert probability[10:].max() < 0.2
    assert np.median(np.hypot(*velocity[10:].T)) < 0.02


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("speed_mps", [1.0, 3.0, 10.0])
def test_starts_and_stops_are_seen(speed_mps, seed):
    still = np.zeros(20)
    moving = np.full(30, speed_mps * PERIOD_S)
    along = np.cumsum(np.concatenate([still, moving, still]))
    probability, velocity = followed(np.column_stack([along, 0.5 * along]), seed)
    start, stop = 19, 49  # numbers of the first step of the motion, and of the first after it
    assert probability[start + 4] > 0.9
    assert_allclose(velocity[stop - 1], [speed_mps, speed_mps / 2], atol=0.3 + 0.05 * speed_mps)
    assert probability[stop + 4] < 0.5
    assert np.hypot(*velocity[stop + 9]) < 0.1


def test_covariances_of_the_velocity_are_true():
    rng = np.random.default_rng(3)
    n = 400
    velocity = rng.normal(0, 2.0, (n, 2)) + 2.0
    position = rng.normal(0, 10.0, (n, 2))
    subject, tracks = begun(position + rng.normal(0, SIGMA_M, (n, 2)))
    for _ in range(6):
        position = position + PERIOD_S * velocity
        step(subject, tracks, position + rng.normal(0, SIGMA_M, (n, 2)))
        velocity += rng.normal(0, PERIOD_S * TUNING.acceleration_sigma_mps2, (n, 2))
    error = tracks.velocity - velocity
    normalised = np.einsum("ni,nij,nj->n", error, np.linalg.inv(tracks.velocity_covariance), error)
    assert 0.5 < np.median(normalised) < 2.0  # of chi-squared with two degrees of freedom: 1.39
    assert np.linalg.eigvalsh(tracks.P).min() > -1e-9


def test_one_jump_is_no_motion():
    positions = np.zeros((30, 2))
    positions[15:] = 0.6
    probability, _ = followed(positions)
    assert probability.max(initial=0.0, where=np.arange(29) > 5) < 0.95
    assert probability[-1] < 0.2


def test_a_track_that_stops_keeps_its_heading():
    along = np.concatenate([np.arange(20) * 0.3, np.full(30, 5.7)])
    subject, tracks = begun([[0.0, 0.0]])
    for y in along[1:]:
        step(subject, tracks, [[0.0, -y]])
    assert tracks.moving_probability[0] < 0.2
    assert tracks.x[0, 2] == pytest.approx(-np.pi / 2, abs=0.05)


def test_a_stalled_clock_changes_nothing():
    subject, tracks = begun([[1.0, 2.0]])
    for _ in range(5):
        step(subject, tracks, [[1.0, 2.0]])
    before = tracks.copy()
    subject.predict(tracks, 0.0)
    assert_allclose(tracks.velocity, before.velocity, atol=1e-12)
    assert_allclose(tracks.P, before.P, atol=1e-12)
