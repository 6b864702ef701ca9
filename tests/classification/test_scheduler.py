"""The scheduler: never over budget, and nobody starves."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from modt.classification.instrumentation import CostedClassifier
from modt.classification.scheduler import LinearCost, Scheduler
from modt.types import NONE, UNLIMITED, Budget, Float32, Float64, Int, Proposals
from tests.classification.scenes import blobs, seen

COUNTS = st.lists(st.integers(1, 400), min_size=1, max_size=20)
BUDGETS = st.builds(
    Budget,
    calls=st.none() | st.integers(0, 10),
    cpu_ms=st.none() | st.floats(0.0, 3.0),
)


@given(counts=COUNTS, budget=BUDGETS, seed=st.integers(0, 1000))
def test_never_over_budget_and_nobody_is_lost(counts: list[int], budget: Budget, seed: int) -> None:
    rng = np.random.default_rng(seed)
    _, proposals = blobs(counts, rng)
    tracks = seen(proposals)
    tracks.waiting = rng.integers(0, 20, len(tracks))
    asks = rng.random(len(tracks)) < 0.7
    cost = LinearCost(400)
    chosen = Scheduler(cost).select(tracks, proposals, asks, budget)
    assert asks[chosen.rows].all()
    assert len(set(chosen.rows.tolist())) == len(chosen.rows)
    assert len(chosen.rows) + chosen.deferred == asks.sum()
    if budget.calls is not None:
        assert len(chosen.rows) <= budget.calls
    if budget.cpu_ms is not None:
        assert cost.cost_ms(proposals.count[chosen.rows]).sum() <= budget.cpu_ms + 1e-9


@given(counts=COUNTS, calls=st.integers(1, 5), seed=st.integers(0, 100))
def test_everything_is_served_in_the_end_although_new_ones_keep_coming(
    counts: list[int], calls: int, seed: int
) -> None:
    _, proposals = blobs(counts, np.random.default_rng(seed))
    tracks = seen(proposals)
    newcomers = len(tracks) // 2  # whoever is served in this half comes back at once, as a new track
    served = np.zeros(len(tracks), np.bool_)
    scheduler = Scheduler(LinearCost(400))
    for _ in range(20 + 2 * len(tracks)):
        asks = ~served | (np.arange(len(tracks)) < newcomers)
        chosen = scheduler.select(tracks, proposals, asks, Budget(calls=calls))
        served[chosen.rows] = True
    assert served.all()


@given(counts=COUNTS, seed=st.integers(0, 100))
def test_a_tight_time_budget_serves_what_fits_in_the_end(counts: list[int], seed: int) -> None:
    _, proposals = blobs(counts, np.random.default_rng(seed))
    tracks = seen(proposals)
    cost = LinearCost(400)
    budget = Budget(cpu_ms=float(cost.cost_ms(np.array([max(counts)]))[0]))
    served = np.zeros(len(tracks), np.bool_)
    for _ in range(2 * len(tracks)):
        served[Scheduler(cost).select(tracks, proposals, ~served, budget).rows] = True
    assert served.all()


def test_without_a_bound_everyone_asking_is_served_the_worthiest_first() -> None:
    _, proposals = blobs([20, 20, 20], np.random.default_rng(0))
    tracks = seen(proposals)
    tracks.key_points[:] = 20
    tracks.posterior[1] = [0.97, 0.01, 0.01, 0.01]
    proposals.box[:, :2] = [20.0, 0.0]
    tracks.waiting[2] = 3
    chosen = Scheduler(LinearCost(400)).select(tracks, proposals, np.ones(3, np.bool_), UNLIMITED)
    assert chosen.rows.tolist() == [2, 0, 1]
    assert chosen.deferred == 0


def test_waiting_counts_the_frames_put_off() -> None:
    _, proposals = blobs([20, 20, 20], np.random.default_rng(0))
    tracks = seen(proposals)
    tracks.proposal[2] = NONE
    tracks.waiting[:] = 5
    chosen = Scheduler(LinearCost(400)).select(tracks, proposals, np.array([True, False, True]), Budget(calls=0))
    assert chosen.deferred == 1
    assert tracks.waiting.tolist() == [6, 0, 5]


def test_no_tracks_are_no_trouble() -> None:
    proposals = Proposals.empty()
    chosen = Scheduler(LinearCost(400)).select(seen(proposals), proposals, np.zeros(0, np.bool_), Budget(1, 1.0))
    assert len(chosen.rows) == chosen.deferred == 0


@given(call=st.floats(0.01, 1.0), point=st.floats(1e-4, 1e-2), seed=st.integers(0, 100))
def test_the_cost_model_learns_its_machine(call: float, point: float, seed: int) -> None:
    rng = np.random.default_rng(seed)
    cost = LinearCost(400)
    for _ in range(120):
        points = rng.integers(5, 400, rng.integers(1, 12))
        cost.learn(points, float((call + point * points).sum()))
    points = np.array([10, 400, 4000])
    true = call + point * np.minimum(points, 400)
    assert cost.cost_ms(points) == pytest.approx(true, rel=0.1)


def test_an_underestimate_widens_the_margin_and_time_narrows_it() -> None:
    cost, points = LinearCost(400), np.full(5, 100)
    for _ in range(50):
        cost.learn(points, 2.0)
    calm = cost.margin
    cost.learn(points, 6.0)
    alarmed = cost.margin
    for _ in range(200):
        cost.learn(points, 2.0)
    assert calm < alarmed
    assert cost.margin < alarmed
    assert cost.cost_ms(points).sum() == pytest.approx(2.0, rel=0.1)


@given(st.lists(st.tuples(st.integers(0, 5000), st.floats(allow_nan=True, allow_infinity=True)), max_size=30))
def test_no_measurement_breaks_the_cost_model(frames: list[tuple[int, float]]) -> None:
    cost = LinearCost(400)
    for points, cpu_ms in frames:
        cost.learn(np.full(3, points), cpu_ms if abs(cpu_ms) < 1e6 else np.nan)
    price = cost.cost_ms(np.array([1, 400]))
    assert np.isfinite(price).all()
    assert (price > 0).all()


def test_the_cost_model_is_taught_what_the_clock_says() -> None:
    class Still:
        def classify(self, points: Float32, proposals: Proposals, which: Int) -> Float64:
            return np.full((len(which), 4), 0.25)

    points, proposals = blobs([40, 60], np.random.default_rng(0))
    cost, clock = LinearCost(400), iter(range(0, 10**9, 3_000_000))
    classifier = CostedClassifier(Still(), cost, lambda: next(clock))
    for _ in range(100):
        out = classifier.classify(points, proposals, np.arange(2))
    assert out.shape == (2, 4)
    assert cost.cost_ms(np.array([40, 60])).sum() == pytest.approx(3.0, rel=0.1)
