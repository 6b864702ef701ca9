"""Load shedding: its steps by event, and when the events come."""

import itertools

import pytest

from modt.app.load_shedding import (
    CALM_S,
    DEFERRED_EVERY,
    MAX_PATIENCE_S,
    LoadShedding,
    Step,
    budget_at,
)
from modt.types import Budget


class Frames:
    """Frames at 10 Hz on a made-up clock."""

    def __init__(self):
        self.shedding = LoadShedding()
        self.now = 0.0
        self.changes = []

    def run(self, seconds, share):
        end = self.now + seconds
        while self.now < end - 1e-9:
            self.now += 0.1
            if self.shedding.frame(self.now, share(self.shedding.step) if callable(share) else share):
                self.changes.append((round(self.now, 1), self.shedding.step))
        return self


UP = [Step.DEFERRED, Step.REDUCED, Step.DROPPED]


@pytest.mark.parametrize(
    ("parts", "steps"),
    [
        ([(0.5, 1.2)], UP),
        ([(0.5, lambda step: 1.1 if step < Step.REDUCED else 0.85)], UP[:2]),
        ([(0.3, 1.2), (60.0, 0.9)], UP),
        ([(0.5, 1.2), (1.0, 0.3)], [*UP, Step.ALL]),
        ([(0.3, 1.2), (0.2, 0.75), (CALM_S + 0.1, 0.3)], [*UP, Step.REDUCED, Step.ALL]),
        ([(0.3, 1.2), (5.0, 0.7)], [*UP, Step.REDUCED, Step.DEFERRED, Step.ALL]),
    ],
    ids=["overruns", "enough", "no slack", "ample slack", "slack that becomes ample", "little slack"],
)
def test_overruns_step_up_one_at_a_time_and_slack_steps_back(parts, steps):
    frames = Frames()
    for seconds, share in parts:
        frames.run(seconds, share)
    assert [step for _, step in frames.changes] == steps
    times = [at for at, step in frames.changes[2:] if step is not Step.ALL]
    assert all(b - a >= CALM_S - 0.01 for a, b in itertools.pairwise(times))


def test_trials_that_fail_become_rare():
    frames = Frames().run(120.0, lambda step: 1.1 if step < Step.REDUCED else 0.7)
    trials = [at for at, step in frames.changes if step is Step.DEFERRED and at > 1]
    gaps = [round(b - a, 1) for a, b in itertools.pairwise(trials)]
    assert len(trials) < 12
    assert gaps == sorted(gaps)
    assert max(gaps) <= MAX_PATIENCE_S + 1.0


def test_a_power_limit_is_kept_by_the_same_steps():
    """Watts fall by a fifth with each step."""
    frames = Frames()
    over = 0
    for _second in range(120):
        frames.run(1.0, 0.3)
        watts = 7.0 - 1.4 * frames.shedding.step
        over += watts > 5.0
        frames.shedding.power(frames.now, watts, 5.0)
    assert over < 20  # of 120 windows: the first ones, and trials
    assert frames.shedding.step in (Step.DEFERRED, Step.REDUCED)


def test_the_budget_is_the_time_that_is_left_or_less():
    assert budget_at(Step.ALL, Budget(16, None), 30.0, 0) == Budget(16, 30.0)
    assert budget_at(Step.ALL, Budget(16, 5.0), 30.0, 0) == Budget(16, 5.0)
    assert budget_at(Step.ALL, Budget(None, 5.0), 0.0, 0) == Budget(None, 0.0)
    assert budget_at(Step.ALL, Budget(16, None, 2.0), 30.0, 0) == Budget(16, 30.0, 2.0)


@pytest.mark.parametrize("step", [Step.DEFERRED, Step.REDUCED, Step.DROPPED])
def test_deferred_calls_are_made_now_and_then(step):
    calls = [budget_at(step, Budget(16, None), 0.0, frame).calls for frame in range(2 * DEFERRED_EVERY)]
    assert sum(calls) == 2
    assert budget_at(step, Budget(0, None), 0.0, 0).calls == 0
