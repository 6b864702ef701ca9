"""Faults of the soak, and its verdict."""

from dataclasses import replace
from itertools import islice
from types import SimpleNamespace

import pytest

from tests.sources.packets.simulated import packets
from tools.deploy.faults import FAULTS, FULL_DISK, NO_FAULT
from tools.deploy.sender import Faulty
from tools.deploy.soak import Episode, Witness, judge
from tools.send.loops import VelodyneStamps


@pytest.mark.parametrize("fault", FAULTS, ids=lambda fault: fault.name)
def test_a_fault_changes_the_packets_from_its_begin_to_its_end(fault):
    before = [payload for _, payload in packets("vlp-16", 3)]
    sent, faulty = iter(enumerate(before)), Faulty()

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
    stamps, faulty = VelodyneStamps(), Faulty()
    faulty.fault = next(fault for fault in FAULTS if fault.clock_s)
    sent = [(0.0, payload) for _, payload in packets("vlp-16", 1)][:4]
    changed = [payload for _, payload in islice(faulty.applied(iter(sent)), 4)]
    for (_, before), after in zip(sent, changed, strict=True):
        step_us = (stamps.stamp_us(after) - stamps.stamp_us(before) + stamps.wrap_us // 2) % stamps.wrap_us
        assert step_us - stamps.wrap_us // 2 == 1e6 * faulty.fault.clock_s


def session(lost):
    recording = SimpleNamespace(health=lambda: {"lost_lines": lost})
    return SimpleNamespace(status=lambda: {"loop": {}}, recording=recording)


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
