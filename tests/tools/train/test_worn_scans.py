"""Simulated sweeps by worn sensors."""

import numpy as np

from modt.geometry import se3
from modt.types import Frame
from modt_simulation.sensors import SENSORS
from tests.tools.train.scans import assert_same
from tools.train import worn_scans


def test_a_sweep_is_the_same_whenever_it_is_made():
    first, second = (list(worn_scans.worn_scans([5])) for _ in range(2))
    assert len(first) == worn_scans.SWEEPS
    assert_same(first, second)


def test_some_beams_are_dead_and_every_second_one_of_a_thinned_sensor(rng):
    dead = [worn_scans.dead_beams(rng, SENSORS["vlp-16"]) for _ in range(400)]
    numbers = np.array([len(rows) for rows in dead])
    assert set(numbers.tolist()) == {0, 1, 2, 3, 8}
    assert 0.5 < (numbers > 0).mean() < 0.7
    assert all(set(np.diff(rows)) == {2} for rows in dead if len(rows) == 8)


def test_points_are_turned_level_and_keep_their_heading():
    roll, pitch, yaw = 0.1, -0.2, 0.7
    R = worn_scans.rotation_zyx(roll, pitch, yaw)
    level = np.array([[10.0, 2.0, -1.0]])
    of_heading = worn_scans.rotation_zyx(0.0, 0.0, yaw)
    points = np.append(level @ of_heading.T @ R, [[0.5]], axis=1).astype(np.float32)
    frame = worn_scans.levelled(Frame(0, 0.0, points, se3(R, np.zeros(3))))
    np.testing.assert_allclose(frame.points[:, :3], level, atol=1e-5)
