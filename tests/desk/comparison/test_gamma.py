import numpy as np
import pytest

from modt.pipeline import STAGES
from modt_desk.comparison.gamma import RunCosts, estimate_gamma
from modt_desk.energy.savings import UnitCosts

from .test_prediction import run_costs

TRUE = UnitCosts(seg=5e-3, track=1e-3, class_call=8e-4, class_item=2e-5, class_point=1.7e-6)
FRAMES, N = 120, 50


def run(classified: np.ndarray, noise: float = 0.0, seed: int = 0) -> RunCosts:
    """A run of known costs that classifies so many of the 50 proposals in each frame."""
    random, every = np.random.default_rng(seed), np.ones(len(classified))
    points = classified * random.integers(50, 200, len(classified))
    counts = {"proposals": N * every, "tracks": 2 * every, "classified_tracks": 2 * every, "classified": classified}
    counts |= {"points": points, "calls": classified > 0}
    network = np.column_stack([classified > 0, classified, points])
    costs = {
        "segmentation": TRUE.seg * every,
        "tracking": TRUE.track * every,
        "scheduling": 1e-4 * every,
        "fusion": 2e-4 * every,
        "classification": network @ [TRUE.class_call, TRUE.class_item, TRUE.class_point],
    }
    return run_costs(counts, costs, random, noise)


def varied(noise: float = 0.0) -> RunCosts:
    return run(np.random.default_rng(7).integers(0, N, FRAMES), noise, seed=8)


EVERY = np.full(FRAMES, N)
FEW = np.full(FRAMES, 2)


def test_intervals_cover_the_truth_with_noise():
    truth = estimate_gamma(run(EVERY), run(FEW), varied(), np.random.default_rng(0)).measured.value
    found = estimate_gamma(run(EVERY, 0.1, 1), run(FEW, 0.1, 2), varied(0.1), np.random.default_rng(0))
    assert found.measured.low < truth < found.measured.high
    assert found.reconciled.low < truth < found.reconciled.high
    assert found.deviation.low < 0 < found.deviation.high


def test_uncounted_cost_is_unexplained():
    dear = run(FEW)
    dear.cost[:, STAGES.index("segmentation")] *= 2
    found = estimate_gamma(run(EVERY), dear, varied(), np.random.default_rng(0))
    terms = found.reconciliation.explain(found.measured.value)
    assert terms[-1].change == pytest.approx(found.measured.value - found.reconciled.value)
    assert terms[-1].change < -0.1
    assert found.deviation.value > 0.05


class Repeated:
    """A pass whose budget of CPU time pays for more or less."""

    def __init__(self, classified: int, slower: float = 1.0) -> None:
        self._run = run(np.full(FRAMES, classified))
        self._slower = slower

    def counts(self) -> np.ndarray:
        return self._run.counts

    def cpu_s(self) -> np.ndarray:
        return self._slower * self._run.cost


def test_counts_and_costs_are_of_the_same_repetition():
    passes = [Repeated(40), Repeated(3), Repeated(8)]
    middle = RunCosts.median(passes)
    np.testing.assert_array_equal(middle.counts, passes[2].counts())
    np.testing.assert_array_equal(middle.cost, passes[2].cpu_s())
    disturbed = RunCosts.median([Repeated(3), Repeated(3, slower=9.0), Repeated(3, slower=1.1)])
    np.testing.assert_allclose(disturbed.cost, 1.1 * passes[1].cpu_s())
