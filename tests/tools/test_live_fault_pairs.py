"""Verdicts over records of live runs with pairs of faults."""

import json
from unittest.mock import Mock

import numpy as np
import pytest

from modt.types import Frame
from tools import live_fault_pairs
from tools.fault_pairs import Episode
from tools.live_fault_pairs import LIVE_FAULTS, NETWORK, PERIOD_S

FAULTS = {fault.name: fault for fault in LIVE_FAULTS}
PAIR = (Episode(FAULTS["covered"], 60, 120, 0.4), Episode(FAULTS["loss"], 80, 140, 0.4))


def recorded(folder, good, lost=3, frames=200, fates=(), sweeps=205):
    """A run directory with 200 recorded frames, of which those of `good` are trusted."""
    lines = [{"stamp_s": PERIOD_S * k, "trust": {"level": "good" if k in good else "blind"}} for k in range(200)]
    (folder / "tracks.jsonl").write_text("\n".join(map(json.dumps, lines)))
    status = {
        "counts": {"frames": frames},
        "recording": {"fates": {"written": 200, "waiting": 0, **dict(fates)}},
        "sensor": {
            "lost_messages": lost,
            "incomplete_sweeps": 0,
            "sweeps": sweeps + frames - 200,
            "dropped_sweeps": 1,
        },
        "loop": {"shed_sweeps": 1, "failures": {"frame: ValueError": 1, "records: OSError": 4}},
    }
    (folder / "status.json").write_text(json.dumps(status))
    (folder / "summary.json").write_text(json.dumps({"faults": {"skipped": 2}}))
    return folder


@pytest.mark.parametrize(
    ("good", "options", "broken"),
    [
        (range(75), {}, []),
        (range(90), {}, ["covered"]),
        (range(75), {"lost": 0}, ["loss"]),
        (range(75), {"frames": 201}, ["1 frames"]),
        (range(75), {"frames": 209, "fates": {"not_encoded": 9}}, ["frames are lost"]),
        (range(75), {"fates": {"written": 199}}, ["200 frames"]),
        (range(75), {"sweeps": 206}, ["1 sweeps"]),
    ],
    ids=["kept", "silent", "not counted", "not recorded", "lost", "miscounted", "sweep left"],
)
def test_what_is_silent_or_missing_is_listed(tmp_path, good, options, broken):
    found = list(live_fault_pairs.judged(recorded(tmp_path, good, **options), PAIR, 0.0))
    assert [what.split(":")[0][: len(name)] for what, name in zip(found, broken, strict=True)] == broken


def test_a_pair_overlaps_and_has_one_fault_of_the_network_at_most(rng):
    for _ in range(200):
        one, other = live_fault_pairs.drawn(rng)
        assert one.begin < other.begin < one.end <= other.end
        assert not {one.change.name, other.change.name} <= NETWORK.keys()


def test_a_silence_ends_though_no_packet_of_it_is_sent(monkeypatch):
    """The faults and the poses go on with the packets of the sensor, not with those that arrive."""
    frames = [Frame(k, PERIOD_S * k, np.zeros((1, 4), np.float32), np.eye(4)) for k in range(40)]
    pair = (Episode(FAULTS["silence"], 10, 20, 0.4), Episode(FAULTS["reload"], 15, 25, 0.4))
    signals = []
    sender = live_fault_pairs.Sender(frames, pair, (1, 2), signals.append, lambda: True)
    monkeypatch.setattr(sender, "_await", lambda at_s: None)
    poses = Mock()
    drive = [bytes(live_fault_pairs.PACKET_BYTES)] * (len(frames) * live_fault_pairs.PACKETS_PER_SWEEP)
    sent = list(sender._let_through(sender._drive(drive, frames, poses)))
    assert len(sent) / live_fault_pairs.PACKETS_PER_SWEEP == pytest.approx(30, abs=0.2)
    assert poses.send.call_count == live_fault_pairs.POSES_PER_SWEEP * (len(frames) - 1)
    assert len(signals) == 1
