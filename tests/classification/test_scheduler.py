"""The scheduler stays within its budget and serves every track; the cost model."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from modt.classification.instrumentation import TimedClassifier
from modt.classification.scheduler import LinearCost, Scheduler
from modt.config import SchedulerConfig
from modt.types import NONE, UNLIMITED, Budget, Float32, Float64, Int, Proposals
from tests.classification.scenes import blobs, new_tracks

CONFIG = SchedulerConfig()
COUNTS = st.lists(st.integers(1, 400), min_size=1, max_size=20)
BUDGETS = st.builds(
    Budget,
    calls=st.none() | st.integers(0, 10),
    cpu_ms=st.none() | st.floats(0.0, 3.0),
)


def cost_model() -> LinearCost:
    return LinearCost(400, CONFIG.cost)


@given(counts=COUNTS, budget=BUDGETS, seed=st.integers(0, 1000))
def test_selection_is_within_budget_and_complete(counts: list[int], budget: Budget, seed: int) -> None:
    rng = np.random.default_rng(seed)
    _, proposals = blobs(counts, rng)
    tracks = new_tracks(proposals)
    tracks.waiting = rng.integers(0, 20, len(tracks))
    asks = rng.random(len(tracks)) < 0.7
    cost = cost_model()
    chosen = Scheduler(CONFIG.worth, cost).select(tracks, proposals, asks, budget)
    assert asks[chosen.rows].all()
    assert len(set(chosen.rows.tolist())) == len(chosen.rows)
    assert len(chosen.rows) + chosen.deferred == asks.sum()
    if budget.calls is not None:
        assert len(chosen.rows) <= budget.calls
    if budget.cpu_ms is not None:
        assert cost.cost_ms(proposals.count[chosen.rows]).sum() <= budget.cpu_ms + 1e-9


@given(counts=COUNTS, calls=st.integers(1, 5), seed=st.integers(0, 100))
def test_every_track_is_served_although_new_ones_keep_coming(counts: list[int], calls: int, seed: int) -> None:
    _, proposals = blobs(counts, np.random.default_rng(seed))
    tracks = new_tracks(proposals)
    newcomers = len(tracks) // 2  # a track of this half that was served is replaced by a new one at once
    served = np.zeros(len(tracks), np.bool_)
    scheduler = Scheduler(CONFIG.worth, cost_model())
    for _ in range(20 + 2 * len(tracks)):
        asks = ~served | (np.arange(len(tracks)) < newcomers)
        chosen = scheduler.select(tracks, proposals, asks, Budget(calls=calls))
        served[chosen.rows] = True
    assert served.all()


@given(counts=COUNTS, seed=st.integers(0, 100))
def test_a_tight_time_budget_serves_every_call_that_fits(counts: list[int], seed: int) -> None:
    _, proposals = blobs(counts, np.random.default_rng(seed))
    tracks = new_tracks(proposals)
    cost = cost_model()
    budget = Budget(cpu_ms=float(cost.cost_ms(np.array([max(counts)]))[0]))
    served = np.zeros(len(tracks), np.bool_)
    for _ in range(2 * len(tracks)):
        served[Scheduler(CONFIG.worth, cost).select(tracks, proposals, ~served, budget).rows] = True
    assert served.all()


def test_without_a_budget_all_are_served_by_decreasing_worth() -> None:
    _, proposals = blobs([20, 20, 20], np.random.default_rng(0))
    tracks = new_tracks(proposals)
    tracks.key_points[:] = 20
    tracks.posterior[1] = [0.97, 0.01, 0.01, 0.01]
    proposals.box[:, :2] = [20.0, 0.0]
    tracks.waiting[2] = 3
    chosen = Scheduler(CONFIG.worth, cost_model()).select(tracks, proposals, np.ones(3, np.bool_), UNLIMITED)
    assert chosen.rows.tolist() == [2, 0, 1]
    assert chosen.deferred == 0


def test_waiting_counts_deferred_frames() -> None:
    _, proposals = blobs([20, 20, 20], np.random.default_rng(0))
    tracks = new_tracks(proposals)
    tracks.proposal[2] = NONE
    tracks.waiting[:] = 5
    chosen = Scheduler(CONFIG.worth, cost_model()).select(
        tracks, proposals, np.array([True, False, True]), Budget(calls=0)
    )
    assert chosen.deferred == 1
    assert tracks.waiting.tolist() == [6, 0, 5]


def test_no_tracks() -> None:
    proposals = Proposals.empty()
    chosen = Scheduler(CONFIG.worth, cost_model()).select(
        new_tracks(proposals), proposals, np.zeros(0, np.bool_), Budget(1, 1.0)
    )
    assert len(chosen.rows) == chosen.deferred == 0


@given(call=st.floats(0.01, 1.0), point=st.floats(1e-4, 1e-2), seed=st.integers(0, 100))
def test_cost_model_converges(call: float, point: float, seed: int) -> None:
    rng = np.random.default_rng(seed)
    cost = cost_model()
    for _ in range(120):
        points = rng.integers(5, 400, rng.integers(1, 12))
        cost.update(points, float((call + point * points).sum()))
    points = np.array([10, 400, 4000])
    true = call + point * np.minimum(points, 400)
    assert cost.cost_ms(points) == pytest.approx(true, rel=0.1)


def test_margin_grows_with_an_underestimate_and_decays() -> None:
    cost, points = cost_model(), np.full(5, 100)
    for _ in range(50):
        cost.update(points, 2.0)
    calm = cost.margin
    cost.update(points, 6.0)
    alarmed = cost.margin
    for _ in range(200):
        cost.update(points, 2.0)
    assert calm < alarmed
    assert cost.margin < alarmed
    assert cost.cost_ms(points).sum() == pytest.approx(2.0, rel=0.1)


@given(st.lists(st.tuples(st.integers(0, 5000), st.floats(allow_nan=True, allow_infinity=True)), max_size=30))
def test_cost_model_survives_any_measurement(frames: list[tuple[int, float]]) -> None:
    cost = cost_model()
    for points, cpu_ms in frames:
        cost.update(np.full(3, points), cpu_ms if abs(cpu_ms) < 1e6 else np.nan)
    price = cost.cost_ms(np.array([1, 400]))
    assert np.isfinite(price).all()
    assert (price > 0).all()


def test_timed_classifier_updates_the_cost_model() -> None:
    class Constant:
        def classify(self, points: Float32, proposals: Proposals, which: Int) -> Float64:
            return np.full((len(which), 4), 0.25)

        def facts(self) -> dict[str, str]:
            return {}

    points, proposals = blobs([40, 60], np.random.default_rng(0))
    cost, clock = cost_model(), iter(range(0, 10**9, 3_000_000))
    classifier = TimedClassifier(Constant(), cost, lambda: next(clock))
    for _ in range(100):
        out = classifier.classify(points, proposals, np.arange(2))
    assert out.shape == (2, 4)
    assert cost.cost_ms(np.array([40, 60])).sum() == pytest.approx(3.0, rel=0.1)
