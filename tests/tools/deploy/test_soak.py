"""Faults of the soak, and its verdict."""

from dataclasses import replace
from itertools import islice
from types import SimpleNamespace

import numpy as np
import pytest

from tests.sources.packets.simulated import packets
from tools.deploy.faults import FAULTS, FULL_DISK, NO_FAULT
from tools.deploy.sender import Faulty
from tools.deploy.soak import Episode, ResultLog, judge
from tools.send.loops import VelodyneStamps


@pytest.mark.parametrize("fault", FAULTS, ids=lambda fault: fault.name)
def test_a_fault_changes_the_packets_from_its_begin_to_its_end(fault):
    before = [payload for _, payload in packets("vlp-16", 3)]
    sent = iter(enumerate(before))
    faulty = Faulty()

    def take(n):
        return [payload for _, payload in islice(faulty.applied(sent), n)]

    assert take(50) == before[:50]
    faulty.fault = replace(fault, clock_s=0.0)
    changed = take(50) if fault.network.lost < 1 else []
    changes = fault.network != NO_FAULT.network or fault.packet is not NO_FAULT.packet
    assert (changed != before[50:100]) is changes
    assert {len(payload) for payload in changed} <= {len(before[0])}
    faulty.fault = NO_FAULT
    after = take(20)
    first = before.index(after[0])
    assert after == before[first : first + 20]


def test_the_clock_of_the_sensor_is_set_once_by_its_fault():
    stamps = VelodyneStamps()
    faulty = Faulty()
    faulty.fault = next(fault for fault in FAULTS if fault.clock_s)
    sent = [(0.0, payload) for _, payload in packets("vlp-16", 1)][:4]
    changed = [payload for _, payload in islice(faulty.applied(iter(sent)), 4)]
    for (_, before), after in zip(sent, changed, strict=True):
        step_us = (stamps.stamp_us(after) - stamps.stamp_us(before) + stamps.wrap_us // 2) % stamps.wrap_us
        assert step_us - stamps.wrap_us // 2 == 1e6 * faulty.fault.clock_s


def result_log(full_from=0.0, trusted_from=0.0, missed_at=(), growth=0.0, leaks=0.0, stall_s=0.0):
    seen = ResultLog()
    times_s = 0.1 * np.arange(1, 2000)
    seen.times_s = (times_s + stall_s * (times_s > 49.0)).tolist()
    seen.full = [not 50 < t < full_from for t in times_s]
    seen.trusted = [not 50 < t < trusted_from for t in times_s]
    seen.missed = [sum(at <= t for at in missed_at) for t in times_s]
    seen.resident_mb = (150.0 * (1 + growth * times_s / 100)).tolist()
    seen.descriptors = (12 + (leaks * times_s / 100).astype(int)).tolist()
    return seen


NAMED = {fault.name: fault for fault in FAULTS}
FIRST = FAULTS[0].name


@pytest.mark.parametrize(
    ("seen", "fault", "counted", "lost", "wrong"),
    [
        (result_log(), FIRST, 1, 0, None),
        (result_log(missed_at=(49.0, 51.0)), FIRST, 1, 0, None),
        (result_log(), FIRST, 0, 0, "were not counted"),
        (result_log(full_from=55.0), FIRST, 1, 0, "recovery took 5.0 s"),
        (result_log(trusted_from=54.0), "covered", 1, 0, None),
        (result_log(trusted_from=56.0), "covered", 1, 0, "recovery took 6.0 s"),
        (result_log(missed_at=(30.0,)), FIRST, 1, 0, None),
        (result_log(missed_at=(30.0, 31.0)), FIRST, 1, 0, "2 deadlines missed between faults"),
        (result_log(growth=0.3), FIRST, 1, 0, "memory grew"),
        (result_log(leaks=3), FIRST, 1, 0, "descriptors leaked"),
        (result_log(), FULL_DISK, 7, 7, None),
        (result_log(), FULL_DISK, 7, 8, "1 records lost but on a full disk"),
        (result_log(), "hog", 0, 0, None),
        (result_log(stall_s=0.3), "hog", 0, 0, "hog: 1 of 1 were not counted"),
    ],
)
def test_the_verdict_names_each_shortcoming(seen, fault, counted, lost, wrong, capsys):
    recording = SimpleNamespace(health=lambda: SimpleNamespace(lost_lines=lost))
    service = SimpleNamespace(status=lambda: SimpleNamespace(loop={}), recording=recording)
    found = judge(seen, [Episode(NAMED[fault], 48.0, 3, 50.0, 3 + counted)], service)
    assert [wrong in line for line in found] == ([True] if wrong else [])
    assert fault in capsys.readouterr().out
