"""The mount over minutes: what sags slowly is told, what drives over slopes is not."""

from dataclasses import replace

import numpy as np
import pytest

from modt.geometry import rotation_zyx
from modt.profile import load
from modt.trust.mount import MountHistory
from modt.trust.tuning import MountTuning
from modt.trust.watch import TrustWatch
from modt.types import TrustLevel
from modt_simulation.synthetic_stream import SyntheticStream

TUNING = MountTuning()
START = TUNING.first_looks


def plane(pitch_deg=0.0, roll_deg=0.0):
    """Ground 0.8 m below a sensor, tilted."""
    return np.array([-0.8, np.tan(np.deg2rad(pitch_deg)), np.tan(np.deg2rad(roll_deg))])


def followed(planes, rotations=None):
    history = MountHistory(TUNING)
    for k, each in enumerate(planes):
        history.add(each, None if rotations is None else rotations[k])
    return history


@pytest.mark.parametrize("axis", ["pitch_deg", "roll_deg"])
@pytest.mark.parametrize("looks", [1, 50])
def test_a_mount_that_sags_is_told_however_slowly(axis, looks):
    sag_deg = np.clip(np.arange(START + looks + 60) - START, 0, looks) * 15 / looks
    history = followed([plane(**{axis: each}) for each in sag_deg])
    assert history.is_tilted
    assert history.tilt_deg == pytest.approx(15.0, abs=0.5)


def test_the_mount_is_as_at_the_start_once_it_is_back():
    history = followed([plane()] * START + [plane(12.0)] * 60)
    assert history.is_tilted
    for _ in range(90):
        history.add(plane(), None)
    assert not history.is_tilted


def test_a_ramp_on_which_the_sensor_is_levelled_is_no_mount_that_sags():
    """The level frame stays level, and the ground in it slopes, as long as the robot stands on the ramp."""
    on_ramp = np.arange(START + 60) >= START
    rotations = [rotation_zyx(0.0, np.deg2rad(-12.0), 0.0) if k else np.eye(3) for k in on_ramp]
    sloping = [plane(12.0 if k else 0.0) for k in on_ramp]
    assert followed(sloping, rotations).tilt_deg == pytest.approx(0.0, abs=0.1)
    assert followed(sloping).is_tilted


def test_a_bump_for_some_looks_is_no_mount_that_sags():
    assert not followed([plane()] * START + [plane(12.0)] * 5 + [plane()] * 5).is_tilted


def test_the_watch_tells_a_sensor_that_sags_within_half_a_minute():
    frames = SyntheticStream("yard", "vlp-16", 45.0, seed=12)
    watch = TrustWatch(load("vlp-16").sensor)
    levels = []
    for frame in frames:
        sag_rad = np.deg2rad(15.0) * np.clip((frame.stamp_s - 15.0) / 15.0, 0.0, 1.0)
        points = frame.points[::3].copy()
        points[:, :3] @= rotation_zyx(0.0, sag_rad, 0.0).astype(np.float32).T
        levels.append(watch.add(replace(frame, points=points), frame.T_world_sensor).level)
    assert set(levels[:150]) == {TrustLevel.GOOD}
    assert levels[-1] == TrustLevel.BLIND
    assert "mount" in watch.trust.keys
