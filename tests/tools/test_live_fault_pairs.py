"""Verdicts over records of live runs with pairs of faults."""

import json

import numpy as np
import pytest

from tools import live_fault_pairs
from tools.live_fault_pairs import LIVE_FAULTS, NETWORK, PERIOD_S, LiveEpisode

FAULTS = {fault.name: fault for fault in LIVE_FAULTS}
PAIR = (LiveEpisode(FAULTS["covered"], 60, 120), LiveEpisode(FAULTS["loss"], 80, 140))


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


def test_a_pair_overlaps_and_has_one_fault_of_the_network_at_most():
    rng = np.random.default_rng(0)
    for _ in range(200):
        one, other = live_fault_pairs.drawn(rng)
        assert one.begin < other.begin < one.end <= other.end
        assert not {one.fault.name, other.fault.name} <= NETWORK.keys()
