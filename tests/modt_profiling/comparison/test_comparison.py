import pytest

from modt.types import UNLIMITED, Budget
from modt_profiling.comparison.comparison import COUNTS, ModeRun, interleave, total
from tests.modt_profiling.comparison.test_compare_report import FRAMES, Board, two_cars
from tests.results import CAR, result

SCRIPT = [
    two_cars(0),
    result(1, [3], {0: 7}, {7: CAR}, lost=(8,)),
    two_cars(2),
    result(3, [5], {0: 9}),
    result(4, [], {}),
    result(5, [5], {0: 9}, {9: CAR}),
]
SCRIPTED = FRAMES[: len(SCRIPT)]
CLASSIFIED = [[7, 8], [7], [8], [], [], [9]]


class Scripted(Board):
    """A board that classifies by the script."""

    def __init__(self, name, log):
        super().__init__()
        self.name = name
        self.log = log

    def seen(self, index):
        return SCRIPT[index], CLASSIFIED[index]

    def step(self, frame, budget=UNLIMITED):
        self.log.append((self.name, (frame.index, budget.calls)))
        return super().step(frame, budget)


def mode_run(name, log, budget=lambda index: UNLIMITED):
    pipeline = Scripted(name, log)
    return ModeRun(pipeline, pipeline.ledger, budget)


def test_counts_of_first_further_and_reacquired_views_and_lives_of_tracks():
    one = mode_run("one", [])
    interleave(SCRIPTED, [one], turn=1)
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
    interleave(iter(SCRIPTED), [mode_run(name, log, lambda index: Budget(calls=index)) for name in "ab"], turn)
    assert "".join(name for name, _ in log) == order.replace(" ", "")
    for name in "ab":
        assert [(index, calls) for who, (index, calls) in log if who == name] == [(k, k) for k in range(6)]
