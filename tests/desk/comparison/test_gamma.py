"""Gamma of runs of known costs."""

from types import SimpleNamespace

import numpy as np
import pytest

from modt.pipeline import STAGES
from modt_desk.comparison.gamma import GammaEstimate, RunCosts, estimate_gamma

from .test_prediction import stream


def runs(noise: float = 0.0) -> tuple[RunCosts, RunCosts, RunCosts]:
    """Tracking-by-detection, a mode and the run of varied load on one stream."""
    of = stream(1, noise=noise).runs
    return of["conventional"], of["efficient"], of["varied"]


def estimated(*given: RunCosts) -> GammaEstimate:
    return estimate_gamma(*given, np.random.default_rng(0))


def test_intervals_cover_the_truth_with_noise():
    truth, found = estimated(*runs()).measured.value, estimated(*runs(noise=0.1))
    assert found.measured.low < truth < found.measured.high
    assert found.reconciled.low < truth < found.reconciled.high
    assert found.deviation.low < 0 < found.deviation.high


def test_uncounted_cost_is_unexplained():
    baseline, dear, varied = runs()
    dear.cost[:, STAGES.index("segmentation")] *= 2
    found = estimated(baseline, dear, varied)
    terms = found.reconciliation.explain(found.measured.value)
    assert terms[-1].change == pytest.approx(found.measured.value - found.reconciled.value)
    assert terms[-1].change < -0.1
    assert found.deviation.value > 0.05


def test_counts_and_costs_are_of_the_repetition_of_median_cost():
    run = runs()[0]
    passes = [(run.counts + k, slower * run.cost) for k, slower in enumerate([9.0, 0.5, 1.1])]
    made = [SimpleNamespace(counts=lambda n=n: n, cpu_s=lambda s=s: s) for n, s in passes]
    middle = RunCosts.median(made)
    np.testing.assert_array_equal(middle.counts, passes[2][0])
    np.testing.assert_array_equal(middle.cost, passes[2][1])
