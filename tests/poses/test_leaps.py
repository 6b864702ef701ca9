"""Poses that leap: what rests stays at rest."""

import numpy as np
import pytest

from modt.geometry import rotation_zyx, se3
from modt.poses.leap_watch import LeapWatch
from modt.types import Frame


def frames(leap_m, noise_m=0.0):
    rng = np.random.default_rng(0)
    for k in range(60):
        place = np.array([0.5 * k, leap_m * (k >= 30), 0.0]) + rng.normal(0, noise_m, 3)
        yield Frame(k, 0.1 * k, np.zeros((1, 4), np.float32), se3(rotation_zyx(0, 0, 0.05 * k), place))


def restarts(given):
    watch = LeapWatch()
    return [watch.watched(frame, "drive").restarts for frame in given]


@pytest.mark.parametrize("leap_m", [0.5, 1.5, 40.0])
def test_a_leap_begins_another_world_at_its_frame(leap_m, caplog):
    assert restarts(frames(leap_m)) == [0] * 30 + [1] * 30
    assert caplog.text.count("leaps by") == 1


@pytest.mark.parametrize("noise_m", [0.0, 0.03, 0.1])
def test_a_drive_with_noise_has_no_leap(noise_m):
    assert restarts(frames(0.0, noise_m=noise_m))[-1] == 0


def test_frames_without_poses_are_passed_over():
    some = [f if f.index % 3 else Frame(f.index, f.stamp_s, f.points) for f in frames(0.0)]
    assert restarts(some)[-1] == 0
