"""Given poses that turn wrong while driving: registration places the frames, until the poses are right again."""

import numpy as np
import pytest

from modt.app import assembly
from modt.geometry import FieldOfView, rotation_zyx, se3
from modt.profile import load
from modt_simulation.synthetic_stream import SyntheticStream

ONSET, END = 30, 50


def pose(x, y, yaw):
    return se3(rotation_zyx(0.0, 0.0, yaw), np.array([x, y, 0.0]))


def planar(T):
    return T[0, 3], T[1, 3], np.arctan2(T[1, 0], T[0, 0])


FAULTS = {
    "none": lambda now, onset: now,
    "frozen": lambda now, onset: onset,
    "half the scale": lambda now, onset: (
        onset[0] + (now[0] - onset[0]) / 2,
        onset[1] + (now[1] - onset[1]) / 2,
        now[2],
    ),
    "backwards": lambda now, onset: (2 * onset[0] - now[0], 2 * onset[1] - now[1], now[2]),
    "another frame": lambda now, onset: (-now[1], now[0], now[2]),
    "degrees": lambda now, onset: (now[0], now[1], np.rad2deg(now[2]) + 1.0),
}


@pytest.fixture(scope="module")
def street():
    return list(SyntheticStream("street", "vlp-16", 8.0, seed=3))


@pytest.mark.parametrize("name", FAULTS)
def test_wrong_poses_are_doubted_and_right_ones_believed_again(name, street):
    profile = load("vlp-16")
    mode = assembly.MODES["efficient"]
    continuity = assembly.Continuity()
    pipeline = assembly.pipeline(mode, profile, FieldOfView(), continuity=continuity)
    check = continuity.odometry.pose_check
    onset = planar(street[ONSET - 1].T_world_sensor)
    doubted = []
    off_m = []
    for k, frame in enumerate(street):
        given = planar(frame.T_world_sensor)
        if ONSET <= k < END:
            given = FAULTS[name](given, onset)
        object.__setattr__(frame, "T_world_sensor", pose(*given)) if ONSET <= k < END else None
        true = pose(*planar(street[k].T_world_sensor)) if not ONSET <= k < END else None
        result = pipeline.step(frame, mode.budget(profile))
        doubted.append(check.doubted)
        if true is not None:
            off_m.append(np.hypot(*(result.T_world_sensor - true)[:2, 3]))
    assert not any(doubted[:ONSET])
    assert any(doubted[ONSET : ONSET + 5]) == (name != "none")
    assert not doubted[-1]
    assert max(off_m) < 0.5
