"""The scheduler stays within its budget and serves every track; the cost model."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from modt.classification.call_cost import LinearCost, padded_size, warm_up
from modt.classification.scheduler import Scheduler
from modt.classification.tuning import CallCostTuning
from modt.config import ClassificationConfig
from modt.types import NONE, UNLIMITED, Budget
from tests.classification.scenes import blobs, new_tracks

COUNTS = st.lists(st.integers(1, 400), min_size=1, max_size=20)


def work_ms(points, slow=1.0):
    """CPU time of a frame on some machine [ms]."""
    return slow * float(0.6 + (0.04 + 0.001 * np.minimum(points, 400)).sum()) if len(points) else 0.0


def cost_model(max_points=400, slow=1.0):
    """Cost model of that machine, warmed up."""
    cost = LinearCost(max_points, lambda points: int(np.minimum(points, max_points).sum()))
    for n, size in ((1, 8), (1, 128), (8, 8), (8, 128), (16, 128)):
        cost.warmed_up(np.full(n, size), work_ms(np.full(n, size), slow))
    return cost


@given(counts=COUNTS, calls=st.none() | st.integers(1, 5), seed=st.integers(0, 100))
def test_every_track_is_served_although_new_ones_keep_coming(counts, calls, seed):
    """Limits by a number of calls, or by the CPU time of the largest one."""
    _, proposals = blobs(counts, seed)
    tracks = new_tracks(proposals)
    cost = cost_model()
    budget = Budget(calls=calls) if calls else Budget(cpu_ms=cost.cost_ms(np.array([max(counts)])) + 1e-9)
    newcomers = len(tracks) // 2  # a track of this half that was served is replaced by a new one at once
    served = np.zeros(len(tracks), np.bool_)
    scheduler = Scheduler(cost)
    for _ in range(20 + 2 * len(tracks)):
        asks = ~served | (np.arange(len(tracks)) < newcomers)
        chosen = scheduler.select(tracks, tracks, tracks, proposals, asks, budget)
        served[chosen.rows] = True
    assert served.all()


def test_without_a_budget_all_are_served_by_decreasing_worth():
    _, proposals = blobs([20, 20, 20])
    tracks = new_tracks(proposals)
    tracks.key_points[:] = 20
    tracks.posterior[1] = [0.97, 0.01, 0.01, 0.01]
    proposals.box[:, :2] = [20.0, 0.0]
    tracks.waiting[2] = 3
    chosen = Scheduler(cost_model()).select(tracks, tracks, tracks, proposals, np.ones(3, np.bool_), UNLIMITED)
    assert chosen.rows.tolist() == [2, 0, 1]
    assert chosen.n_deferred == 0


def test_waiting_counts_deferred_frames():
    _, proposals = blobs([20, 20, 20])
    tracks = new_tracks(proposals)
    tracks.proposal[2] = NONE
    tracks.waiting[:] = 5
    chosen = Scheduler(cost_model()).select(
        tracks, tracks, tracks, proposals, np.array([True, False, True]), Budget(calls=0)
    )
    assert chosen.n_deferred == 1
    assert tracks.waiting.tolist() == [6, 0, 5]


@cache
def dozen(number):
    """A dozen proposals of some sizes."""
    rng = np.random.default_rng([12, number])
    return blobs(rng.integers(5, 300, 12).tolist(), rng)[1]


SCENES = 400
"""Different frames; longer drives repeat them."""


def drive(budget, n, cost=None, seed=0, slow=1.0, ask=1.0, period_s=0.1):
    """(n,) CPU time and calls of frames in which a dozen proposals ask, or none, on a machine of some noise."""
    rng = np.random.default_rng(seed)
    scheduler = Scheduler(cost or cost_model(), period_s)
    tracks = new_tracks(dozen(0))
    times = np.zeros(n)
    calls = np.zeros(n, np.int64)
    for k in range(n):
        proposals = dozen((100 * seed + k) % SCENES)
        rows = scheduler.select(tracks, tracks, tracks, proposals, np.full(12, rng.random() < ask), budget).rows
        calls[k] = len(rows)
        points = proposals.count[rows]
        if len(rows):
            times[k] = work_ms(points, slow) * rng.lognormal(0.0, 0.12)
            scheduler.record_cost(points, times[k])
    return times, calls


@pytest.mark.slow
@given(call=st.floats(0.01, 1.0), point=st.floats(1e-4, 1e-2), frame=st.floats(0.0, 1.0), seed=st.integers(0, 100))
def test_cost_model_converges(call, point, frame, seed):
    rng = np.random.default_rng(seed)
    cost = cost_model()
    for _ in range(300):
        points = rng.integers(5, 400, rng.integers(1, 12))
        cost.update(points, float(frame + (call + point * points).sum()))
    excess = []
    for points in (np.array([10]), np.array([400]), np.array([10, 400, 4000])):
        excess.append(cost.cost_ms(points) / (frame + float((call + point * np.minimum(points, 400)).sum())))
    assert min(excess) >= 1.0
    assert max(excess) < 1.2 * min(excess)
    assert max(excess) < 3.0


@pytest.mark.parametrize(("budget_ms", "slow"), [(0.3, 1.0), (0.8, 1.0), (2.0, 1.0), (1.5, 0.3), (1.5, 3.0)])
def test_a_budget_is_kept_in_99_of_100_frames_and_starves_nobody(budget_ms, slow):
    """Also where the warm-up measured another speed."""
    times, calls = drive(Budget(cpu_ms=budget_ms), 2000, cost_model(slow=slow))
    assert (times > budget_ms).mean() <= 0.01
    assert calls[-110:].any()
    if budget_ms >= 1.0:
        assert times[500:].mean() > 0.5 * budget_ms


@pytest.mark.parametrize(
    ("mean_ms", "period_s"),
    [(0.01, 0.1), (0.05, 0.05), (0.05, 0.5), (0.3, 0.1), (0.65, 0.5), (2.0, 0.05), (2.0, 0.5)],
)
def test_a_mean_budget_is_kept_in_the_mean_and_spent(mean_ms, period_s):
    times, _ = drive(Budget(mean_ms=mean_ms), 3000, period_s=period_s)
    assert times.mean() <= mean_ms + 1.0 / 3000  # at most one call on credit
    assert times.mean() > 0.7 * mean_ms
    longest = np.diff(times.nonzero()[0]).max()
    assert longest <= 2 + 2.5 * times.max() / mean_ms


def test_what_is_saved_is_a_seconds_worth_at_most():
    assert 2.0 < drive(Budget(mean_ms=1.0), 3000, ask=0.02)[0].max() <= 10.0
    within = Budget(mean_ms=1.0, cpu_ms=1.5)  # what is left of the period
    assert drive(within, 3000, ask=0.02)[0].max() < 2.0


@pytest.mark.parametrize("nothing", [Budget(mean_ms=0.0), Budget(cpu_ms=0.0), Budget(calls=0)])
def test_a_budget_of_nothing_buys_nothing(nothing):
    assert drive(nothing, 350)[1].sum() == 0


def test_a_large_proposal_is_saved_for_while_small_ones_ask():
    """Calls of less worth wait, else they would spend the budget that it needs."""
    _, proposals = blobs([400] + [5] * 11)
    tracks = new_tracks(proposals)
    scheduler = Scheduler(cost_model())
    served = np.zeros(12, np.int64)
    for _ in range(400):
        rows = scheduler.select(tracks, tracks, tracks, proposals, np.ones(12, np.bool_), Budget(mean_ms=0.3)).rows
        served[rows] += 1
        if len(rows):
            scheduler.record_cost(proposals.count[rows], work_ms(proposals.count[rows]))
    assert served.min() > 2


@pytest.mark.parametrize(("n", "slow", "settled"), [(1, 20.0, 0), (300, 3.0, 200)])
def test_a_machine_that_was_slow_is_used_again(n, slow, settled):
    """At once after one frame, after some time where it was slow for a while."""
    cost = cost_model()
    _, before = drive(Budget(cpu_ms=2.0), 300, cost)
    drive(Budget(cpu_ms=2.0), n, cost, seed=1, slow=slow)
    _, after = drive(Budget(cpu_ms=2.0), settled + 50, cost, seed=2)
    assert after[settled:].mean() > 0.5 * before[-100:].mean() > 0


@given(st.lists(st.tuples(st.integers(0, 5000), st.floats(allow_nan=True, allow_infinity=True)), max_size=30))
def test_cost_model_survives_any_measurement(frames):
    cost = cost_model()
    for points, cpu_ms in frames:
        cost.update(np.full(3, points), cpu_ms if abs(cpu_ms) < 1e6 else np.nan)
        cost.record_starved_frame()
    price = np.array([cost.cost_ms(np.array([1])), cost.cost_ms(np.array([400]))])
    assert np.isfinite(price).all()
    assert (price >= 0).all()


@pytest.mark.parametrize(("likelihood", "points"), [("network", 6 * 400), ("pooled", 3 * 20 + 290 + 2 * 400)])
def test_points_are_counted_with_padding(likelihood, points):
    size = padded_size(ClassificationConfig(likelihood=likelihood, max_points=400))
    assert size(np.array([10, 700, 290, 10, 20, 400])) == points
    assert size(np.zeros(0, np.int64)) == 0


def test_the_warm_up_classifies_small_and_large_frames_and_prices_them():
    sizes = []
    clock = iter(range(0, 10**12, 2_000_000))
    cost = LinearCost(128, lambda points: int(points.sum()))
    warm_up(lambda _, __, which: sizes.append(len(which)), cost, 128, 8, lambda: next(clock))
    assert set(sizes) == {1, 8, 16}
    assert cost.cost_ms(np.array([60])) == pytest.approx(CallCostTuning().start_margin * 2.0, rel=0.01)
