"""Gamma and predictions on streams of known costs.

A prediction misses where unit costs or counts are not those of its calibration.
"""

from types import SimpleNamespace

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from modt.pipeline import STAGES
from modt_profiling.comparison.comparison import COUNTS
from modt_profiling.comparison.gamma import GammaEstimate, RunCosts, estimate_gamma
from modt_profiling.comparison.prediction import OBSERVED, Rates, Stream, expect, forecast, measured

SEG_S = 5e-8
TRACK_S = (1e-3, 5e-5, 2e-5)
SCHEDULE_S = (2e-4, 1e-6)
CLASS_S = (5e-4, 4e-4, 1e-6)
GAMMA = slice(3, None)
FRAMES = 240


def run(mode: str, seen: np.ndarray, n_go: float, random: np.random.Generator, noise: float) -> RunCosts:
    """A run of known costs on (F, 3) proposals, new tracks, points of the sweep."""
    proposals, started, sweep_points = seen.T
    classified = {
        "conventional": proposals,
        "efficient": np.minimum(started, proposals),
        "accurate": np.minimum(random.poisson(3 * proposals.mean() / n_go, FRAMES), proposals),
        "varied": np.minimum(random.integers(0, 60, FRAMES), proposals),
    }[mode]
    network = np.array([random.integers(40, 160, k).sum() for k in classified])
    counts = {
        "proposals": proposals,
        "tracks": started,
        "classified": classified,
        "points": network,
        "calls": classified > 0,
        "sweep_points": sweep_points,
        "alive": proposals + 2,
    }
    costs = {
        "segmentation": SEG_S * sweep_points,
        "tracking": np.stack([np.ones(FRAMES), proposals, proposals + 2], 1) @ TRACK_S,
        "scheduling": SCHEDULE_S[0] + SCHEDULE_S[1] * (proposals + 2),
        "classification": np.stack([classified > 0, classified, network], 1) @ CLASS_S,
    }
    table = np.zeros((FRAMES, len(COUNTS)), np.int64)
    cost = np.zeros((FRAMES, len(STAGES)))
    for name, value in counts.items():
        table[:, COUNTS.index(name)] = value
    for stage, spent_s in costs.items():
        cost[:, STAGES.index(stage)] = spent_s
    return RunCosts(table, cost * (1 + noise * random.standard_normal(cost.shape)))


def stream(seed: int, n: int = 40, n_go: float = 20.0, points: int = 100_000, noise: float = 0.05) -> Stream:
    """A stream on which four in five new tracks ask for a class."""
    random = np.random.default_rng(seed)
    proposals = np.maximum(random.poisson(n, FRAMES), 1)
    started = random.poisson(n / n_go, FRAMES)
    started[0] = n
    seen = np.column_stack([proposals, started, random.normal(points, points / 50, FRAMES).astype(int)])
    modes = ("conventional", "efficient", "accurate", "varied")
    runs = {mode: run(mode, seen, n_go, random, noise) for mode in modes}
    seen = runs["conventional"].counts[:, [COUNTS.index(name) for name in OBSERVED]]
    asked = random.binomial(seen[:, OBSERVED.index("tracks")], 0.8)
    return Stream(runs, np.column_stack([seen, asked, asked]))


CALIBRATION = [stream(1, 30, 15.0, 110_000), stream(2, 50, 25.0, 90_000), stream(3, 25, 10.0, 120_000)]
TEST = stream(9, 40, 30.0, 60_000)


def predicted(calibration: list[Stream], seen: Stream = TEST):
    """Forecast from a third of the frames."""
    return forecast(calibration, seen.observed[: FRAMES // 3], FRAMES, np.random.default_rng(0))


@pytest.fixture(scope="module")
def prediction():
    """Forecast of the test's stream by all calibrations."""
    return predicted(CALIBRATION)


def covers(found, values: np.ndarray) -> np.ndarray:
    return (found.low < values) & (values < found.high)


def test_unit_costs_are_found():
    found = Rates.fit(CALIBRATION)
    assert found.segmentation @ [1.0, 60_000] == pytest.approx(60_000 * SEG_S, rel=0.02)
    # points and proposals vary together from frame to frame: their sum is determined
    assert found.classification @ [1, 40, 4000] == pytest.approx(CLASS_S @ np.array([1, 40, 4000]), rel=0.02)
    assert found.tracking["efficient"] @ [1, 40, 42] == pytest.approx(TRACK_S @ np.array([1, 40, 42]), rel=0.02)
    assert found.views["accurate"].each == pytest.approx(3.0 / 0.8, rel=0.15)


def test_sweeps_of_different_sizes_tell_the_constant_of_segmentation():
    streams = [stream(1, points=120_000), stream(2, points=30_000)]
    for each in streams:
        for mode in each.runs.values():
            mode.cost[:, STAGES.index("segmentation")] += 2e-3
    assert_allclose(Rates.fit(streams).segmentation, [2e-3, SEG_S], rtol=0.05)
    assert Rates.fit(streams[:1]).segmentation[0] == 0.0


def test_another_stream_is_predicted(prediction):
    truth = measured(TEST)
    assert truth[GAMMA].min() > 2.5
    for found in (prediction, predicted(CALIBRATION[:1])):
        assert_allclose(found.expected.values, truth, rtol=0.12)
        assert covers(found, truth).all()


def test_it_is_nearer_than_simple_guesses(prediction):
    truth = measured(TEST)
    equation = prediction.expected.equation
    for k in (3, 4):
        error = abs(np.log(prediction.expected.values[k] / truth[k]))
        rivals = (equation.n_go, equation.gamma, prediction.copied[k])
        assert all(error < 0.5 * abs(np.log(rival / truth[k])) for rival in rivals)


def test_it_misses_where_tracks_are_ten_times_as_many_or_cost_twice_as_much(prediction):
    broken = Stream(TEST.runs, TEST.observed.copy())
    broken.observed[:, [OBSERVED.index("tracks"), -2, -1]] *= 10
    assert not covers(predicted(CALIBRATION, broken), measured(TEST))[GAMMA].any()
    dear = Stream({name: RunCosts(each.counts, each.cost.copy()) for name, each in TEST.runs.items()}, TEST.observed)
    for each in dear.runs.values():
        each.cost[:, STAGES.index("tracking")] *= 2
    assert not covers(prediction, measured(dear)).any()


def test_a_stream_without_proposals_saves_nothing():
    found = expect(Rates.fit(CALIBRATION), np.zeros((3, 7), np.int64), 10)
    assert found.cost["conventional"] == pytest.approx(found.cost["efficient"], rel=0.05)
    assert found.equation.gamma == 1.0


def three_runs(noise: float = 0.0) -> tuple[RunCosts, RunCosts, RunCosts]:
    """Tracking-by-detection, a mode and the run of varied load on one stream."""
    of = stream(1, noise=noise).runs
    return of["conventional"], of["efficient"], of["varied"]


def estimated(*given: RunCosts) -> GammaEstimate:
    return estimate_gamma(*given, np.random.default_rng(0))


def test_intervals_cover_the_truth_with_noise():
    truth = estimated(*three_runs()).measured.value
    found = estimated(*three_runs(noise=0.1))
    assert found.measured.low < truth < found.measured.high
    assert found.reconciled.low < truth < found.reconciled.high
    assert found.deviation.low < 0 < found.deviation.high


def test_uncounted_cost_is_unexplained():
    baseline, dear, varied = three_runs()
    dear.cost[:, STAGES.index("segmentation")] *= 2
    found = estimated(baseline, dear, varied)
    terms = found.reconciliation.explain(found.measured.value)
    assert terms[-1].change == pytest.approx(found.measured.value - found.reconciled.value)
    assert terms[-1].change < -0.1
    assert found.deviation.value > 0.05


def test_counts_and_costs_are_of_the_repetition_of_median_cost():
    run = three_runs()[0]
    passes = [(run.counts + k, slower * run.cost) for k, slower in enumerate([9.0, 0.5, 1.1])]
    made = [SimpleNamespace(counts=lambda n=n: n, cpu_s=lambda s=s: s) for n, s in passes]
    middle = RunCosts.median(made)
    assert_array_equal(middle.counts, passes[2][0])
    assert_array_equal(middle.cost, passes[2][1])
