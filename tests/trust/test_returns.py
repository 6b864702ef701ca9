"""Returns by sector and beam of sensors that do not stay level."""

import numpy as np
import pytest

from modt.geometry import rotation_zyx
from modt.profile import load
from modt.trust.returns import ReturnsCheck
from modt.trust.sample import sample
from modt.trust.tuning import TrustTuning
from modt.types import Frame

HEIGHT_M = 0.5
WALL_M = 15.0
LOWEST_DEG, HIGHEST_DEG = -7.0, 25.0
STEP_RAD = 2 * np.pi * 0.2
"""Phase of a gait of 2 Hz from sweep to sweep."""


def sweep(k, tilt_deg=(0.0, 0.0), lowest_deg=LOWEST_DEG, seen_deg=180.0):
    """Level sweep k of a sensor that is rolled and pitched, on a floor with a wall all round.

    There are no returns from bearings farther than `seen_deg` to either side.
    """
    elevation, azimuth = np.deg2rad(np.mgrid[LOWEST_DEG:HIGHEST_DEG:20j, 0:356.4:100j].reshape(2, -1))
    alive = elevation >= np.deg2rad(lowest_deg)
    rays = np.stack([np.cos(azimuth) * np.cos(elevation), np.sin(azimuth) * np.cos(elevation), np.sin(elevation)])
    roll, pitch = np.deg2rad(tilt_deg)
    R = rotation_zyx(roll, pitch, 0.0)
    x, y, z = R @ rays[:, alive]
    range_m = np.minimum(WALL_M / np.hypot(x, y), HEIGHT_M / np.maximum(-z, 1e-3))
    points = np.stack([x * range_m, y * range_m, z * range_m, np.zeros(len(x))], axis=1).astype(np.float32)
    points = points[np.abs(np.arctan2(points[:, 1], points[:, 0])) < np.deg2rad(seen_deg)]
    frame = Frame(k, 0.1 * k, points, R_level_sensor=R)
    return sample(frame, np.eye(4), load("mid-360").sensor, np.array([-HEIGHT_M, 0.0, 0.0]))


@pytest.mark.parametrize(("lowest_deg", "expected"), [(LOWEST_DEG, None), (8.0, "no returns from the lower beams")])
def test_a_level_sweep_among_tilted_ones_has_lost_no_beams_unless_it_has(lowest_deg, expected):
    check = ReturnsCheck(TrustTuning().returns)
    gait = [sweep(k, 6 * np.sin([STEP_RAD * k, STEP_RAD * k + np.pi / 2])) for k in range(1, 13)]
    for one in gait:
        check.learn(one, 0.6)
    loss = check.loss([*gait[-4:], sweep(13, (0.0, 0.0), lowest_deg)])
    assert (loss and loss.what.partition(",")[0]) == expected


def test_beams_that_die_while_a_part_of_the_view_is_lost_are_counted():
    check = ReturnsCheck(TrustTuning().returns)
    whole = [sweep(k) for k in range(3)]
    for one in whole:
        check.learn(one, 1.0)
    covered = [sweep(k, seen_deg=120.0) for k in range(3, 6)]
    assert check.loss([whole[-1], *covered]).what.startswith("no returns from behind")
    assert check.n_dead == 0
    assert check.loss([covered[-1], *(sweep(k, (0.0, 0.0), 8.0, 120.0) for k in range(6, 9))]) is not None
    assert check.n_dead > 0
