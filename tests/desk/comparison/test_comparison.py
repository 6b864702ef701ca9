from dataclasses import replace

import numpy as np
import pytest

from modt.config import EnergyConfig
from modt.energy.ledger import Ledger
from modt.energy.meters.meter import Conditions, model_meter
from modt.energy.windows import Clocks, Windows
from modt.types import UNLIMITED, Budget, Frame
from modt_desk.comparison.comparison import COUNTS, ModeRun, interleave, total
from tests.results import CAR, result

FRAMES = [Frame(k, k / 10, np.zeros((40, 4), np.float32)) for k in range(6)]

SCRIPT = [
    result(0, [3, 4], {0: 7, 1: 8}, {7: CAR, 8: CAR}),
    result(1, [3], {0: 7}, {7: CAR}, lost=(8,)),
    result(2, [3, 4], {0: 7, 1: 8}, {7: CAR, 8: CAR}),
    result(3, [5], {0: 9}),
    result(4, [], {}),
    result(5, [5], {0: 9}, {9: CAR}),
]
CLASSIFIED = [[7, 8], [7], [8], [], [], [9]]


class Scripted:
    """A pipeline that classifies what the script says."""

    def __init__(self, name, ledger, log):
        self.name, self.ledger, self.log = name, ledger, log

    def step(self, frame, budget=UNLIMITED):
        self.log.append((self.name, (frame.index, budget.calls)))
        classified = np.array(CLASSIFIED[frame.index], np.int64)
        if len(classified):
            self.ledger.run("classification", np.tile, CAR, (len(classified), 1))
        return replace(SCRIPT[frame.index], classified=classified)


def mode_run(name, log, budget=lambda index: UNLIMITED, windows=None):
    ledger = Ledger()
    return ModeRun(Scripted(name, ledger, log), ledger, budget, windows)


def test_counts_of_first_further_and_reacquired_views_and_lives_of_tracks():
    one = mode_run("one", [])
    interleave(FRAMES, [one], turn=1)
    expected = {
        "proposals": [2, 1, 2, 1, 0, 1],
        "tracks": [2, 0, 0, 1, 0, 1],
        "classified_tracks": [2, 0, 0, 0, 0, 1],
        "classified": [2, 1, 1, 0, 0, 1],
        "reacquired": [0, 0, 1, 0, 0, 0],
        "calls": [1, 1, 1, 0, 0, 1],
        "foreground": [2, 1, 2, 0, 0, 1],
    }
    assert {name: one.counts()[:, COUNTS.index(name)].tolist() for name in expected} == expected
    assert one.lengths.occurrences() == {"values": [1, 2, 3], "counts": [2, 1, 1]}, "frames with a proposal"
    counts = total(one.counts())
    assert (counts.tracks, counts.n_go) == (one.lengths.count, pytest.approx(one.lengths.mean))


@pytest.mark.parametrize(
    ("turn", "order"), [(1, "ab ba ab ba ab ba"), (2, "aabb bbaa aabb"), (10**9, "aaaaaabbbbbb")]
)
def test_every_run_has_every_frame_with_its_budget_and_the_first_rotates(turn, order):
    log = []
    interleave(iter(FRAMES), [mode_run(name, log, lambda index: Budget(calls=index)) for name in "ab"], turn)
    assert "".join(name for name, _ in log) == order.replace(" ", "")
    for name in "ab":
        assert [(index, calls) for who, (index, calls) in log if who == name] == [(k, k) for k in range(6)]


def test_meters_are_read_at_the_ends_of_turns():
    now = [0]

    def tick():
        now[0] += 1_000_000
        return now[0]

    clocks = Clocks(tick, tick, tick)
    metered = [Windows([model_meter(EnergyConfig(), tick, tick)], clocks, Conditions(), min_s=1e9) for _ in "ab"]
    made = [mode_run(name, [], windows=windows) for name, windows in zip("ab", metered, strict=True)]
    interleave(FRAMES, made, turn=3)
    for each in made:
        assert [line["frames"][2] for line in each.energy_lines] == [3, 3]
        assert all(line["energy_J"] > 0 for line in each.energy_lines)
