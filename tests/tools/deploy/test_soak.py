"""Faults of the soak, and its verdict."""

from types import SimpleNamespace

import numpy as np
import pytest

from modt.app.timing import Timing
from modt.sources.live.sweep_reader import Sweep
from tools.deploy.faults import FAULTS, FULL_DISK
from tools.deploy.soak import Episode, Witness, judge

SWEEP = Sweep(10.0, np.random.default_rng(0).uniform(-30, 30, (500, 4)).astype(np.float32))


@pytest.mark.parametrize("fault", FAULTS, ids=lambda fault: fault.name)
def test_a_fault_makes_sweeps_that_a_sensor_could_send_and_leaves_its_own_alone(fault):
    before = SWEEP.points.copy()
    for sweep in fault.sweeps(SWEEP, np.random.default_rng(1)):
        assert sweep.points.dtype == np.float32
        assert sweep.points.shape[1] == 4
    np.testing.assert_array_equal(SWEEP.points, before)


def session(lost):
    recording = SimpleNamespace(health=lambda: {"lost_lines": lost})
    return SimpleNamespace(deadlines=Timing(), recording=recording)


def witness(full_from=0.0, missed_at=(), growth=0.0, leaks=0.0):
    seen = Witness()
    for k in range(1, 2000):
        seen.times_s.append(0.1 * k)
        seen.full.append(not 50 < 0.1 * k < full_from)
        seen.missed.append(sum(at <= 0.1 * k for at in missed_at))
        seen.resident_mb.append(150.0 * (1 + growth * k / 1000))
        seen.descriptors.append(12 + int(leaks * k / 1000))
    return seen


EPISODE = (FAULTS[0], 48.0, 3, 50.0, 4)


@pytest.mark.parametrize(
    ("seen", "episode", "wrong"),
    [
        (witness(), EPISODE, None),
        (witness(missed_at=(49.0, 51.0)), EPISODE, None),
        (witness(), (*EPISODE[:4], 3), "were not counted"),
        (witness(full_from=55.0), EPISODE, "recovery took 5.0 s"),
        (witness(missed_at=(30.0,)), EPISODE, None),
        (witness(missed_at=(30.0, 31.0)), EPISODE, "2 deadlines missed between faults"),
        (witness(growth=0.3), EPISODE, "memory grew"),
        (witness(leaks=3), EPISODE, "descriptors leaked"),
    ],
)
def test_the_verdict_names_what_is_wrong(seen, episode, wrong, capsys):
    found = judge(seen, [Episode(*episode)], session(0))
    assert [wrong in line for line in found] == ([True] if wrong else [])
    assert FAULTS[0].name in capsys.readouterr().out


@pytest.mark.parametrize(("lost", "wrong"), [(7, []), (8, ["1 records lost but on a full disk"])])
def test_records_may_be_lost_on_a_full_disk_alone(lost, wrong):
    disk = next(fault for fault in FAULTS if fault.name == FULL_DISK)
    assert judge(witness(), [Episode(disk, 48.0, 3, 50.0, 10)], session(lost)) == wrong


@pytest.mark.parametrize(("stall_s", "wrong"), [(0.0, []), (0.3, ["hog: 1 of 1 were not counted"])])
def test_a_hog_that_costs_nothing_need_not_be_counted(stall_s, wrong):
    hog, seen = next(fault for fault in FAULTS if fault.name == "hog"), witness()
    seen.times_s = [t + stall_s * (t > 49.0) for t in seen.times_s]
    assert judge(seen, [Episode(hog, 48.0, 3, 50.0, 3)], session(0)) == wrong
