"""Every point of a sweep of any shape has one label; `python -m tools.sequences --sweeps N` makes many."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import Phase, given, settings
from hypothesis import strategies as st

from modt.types import UNLIMITED, Frame, PointKind
from tests.sequences import promises
from tests.sequences.sweeps import MAKERS, feed, random_sweep


@given(st.integers(0, 2**32 - 1))
@settings(max_examples=30, deadline=None, phases=(Phase.generate,))
def test_labels_of_random_sweeps(seed):
    feed(seed, 10)


@pytest.mark.parametrize("maker", dict.fromkeys(MAKERS), ids=lambda maker: maker.__name__)
def test_makers_give_points(maker):
    sweeps = [maker(np.random.default_rng(seed)) for seed in range(20)]
    assert {(s.dtype, s.shape[1:]) for s in sweeps} == {(np.dtype(np.float32), (4,))}
    assert maker.__name__ == "empty" or max(map(len, sweeps)) > 100


def test_sweeps_hold_values_that_are_not_finite_and_huge_ones():
    sweeps = [random_sweep(np.random.default_rng(seed)) for seed in range(300)]
    assert 20 < sum(not np.isfinite(s).all() for s in sweeps) < 200
    assert sum(len(s) > 0 and np.nanmax(np.abs(s)) > 1e6 for s in sweeps) > 20


def test_a_point_of_a_proposal_that_is_ground_as_well_breaks_the_promise():
    run = promises.Run("accurate", promises.config("vlp-16", "kdop"), UNLIMITED)
    points = np.random.default_rng(0).uniform([4, 0, -0.5, 0], [4.4, 0.4, 1.0, 1], (200, 4)).astype(np.float32)
    result = run.step(Frame(0, 0.0, points, np.eye(4)))
    assert len(result.proposals) == 1
    kind = result.proposals.kind.copy()
    kind[result.proposals.members[0]] = PointKind.GROUND
    with pytest.raises(AssertionError):
        run._labels(replace(result, proposals=replace(result.proposals, kind=kind)))
