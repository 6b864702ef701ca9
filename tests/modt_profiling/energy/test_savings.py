import math
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from modt_profiling.energy.savings import Counts, EnergyModel, OtherCosts, UnitCosts, reconcile

COSTS = UnitCosts(seg=5e-3, track=1e-3, class_call=1e-4, class_item=2e-4, class_point=1e-6)
NOTHING = OtherCosts(0.0, 0.0)
SAME = OtherCosts(1e-3, 0.0)


def baseline(frames: int = 100, n: int = 40) -> Counts:
    total = frames * n
    return Counts(frames, total, total // 10, 100, total, total, 0, total * 100, frames)


def efficient(tracks: int = 200, reached: int = 200, classified: int = 200, reacquired: int = 0) -> Counts:
    return Counts(100, 4000, 400, tracks, reached, classified, reacquired, classified * 60, min(classified, 100))


@given(st.floats(1e-4, 1.0), st.floats(1e-5, 0.1), st.integers(1, 60), st.integers(1, 400))
def test_neutral_parameters_are_the_papers_equation(seg, item, n, tracks):
    base = replace(baseline(n=n), points=0)
    run = replace(base, tracks=tracks, classified_tracks=tracks, classified=tracks)
    found = reconcile(base, run, UnitCosts(seg, 0.0, 0.0, item, 0.0), NOTHING, NOTHING)
    paper = EnergyModel(seg, item, n, run.n_go)
    assert found.model.gamma == pytest.approx(paper.gamma)
    assert found.paper.gamma == pytest.approx(paper.gamma)
    assert found.paper.short_form_error == pytest.approx(paper.short_form_error)


counts = st.builds(
    lambda tracks, reached, repeats, reacquired, points: replace(
        efficient(tracks, min(reached, tracks), min(reached, tracks) + repeats + reacquired, reacquired),
        points=points,
    ),
    st.integers(1, 4000), st.integers(0, 4000), st.integers(0, 500), st.integers(0, 50), st.integers(0, 10**6),
)  # fmt: skip


@given(counts, st.floats(1e-6, 1e-2), st.floats(0, 1e-2), st.floats(0, 100))
def test_the_terms_add_up_to_the_deviation(run, seg, choose, measured):
    found = reconcile(
        baseline(), run, replace(COSTS, seg=seg), OtherCosts(1e-3, choose), OtherCosts(2e-3, 2 * choose)
    )
    assert found.paper.n_go + sum(t.change for t in found.terms) == pytest.approx(found.model.gamma, abs=1e-6)
    explained = found.explain(measured)
    assert found.paper.n_go + sum(t.change for t in explained) == pytest.approx(measured, abs=1e-6)
    assert explained[-1].gamma == measured


@given(counts)
def test_energy_of_the_model_is_counts_times_costs(run):
    base = baseline()
    found = reconcile(base, run, COSTS, OtherCosts(2e-3, 1e-4), OtherCosts(3e-3, 3e-4))
    assert found.model.e1 == pytest.approx(COSTS.seg + 2e-3 + 1e-4 + COSTS.classification(base) / base.frames)
    if run.classified:
        assert found.model.e2 == pytest.approx(COSTS.seg + 3e-3 + 3e-4 + COSTS.classification(run) / run.frames)
    assert found.model.views == pytest.approx(run.classified / run.tracks)


def test_empty_runs_save_nothing():
    nothing = Counts(0, 0, 0, 0, 0, 0, 0, 0, 0)
    found = reconcile(nothing, nothing, COSTS, SAME, SAME)
    assert found.model.gamma == pytest.approx(1.0)
    assert (nothing.beta, nothing.n_go, nothing.n, nothing.n_obj) == (1.0, 1.0, 0.0, 0.0)
    assert EnergyModel(0, 0, 0, 1).gamma == 1.0
    assert math.isinf(EnergyModel(0, 0, 0, 1).a)


positive = st.floats(1e-3, 1e3)
models = st.builds(EnergyModel, e_seg=positive, e_class=positive, n=positive, n_go=st.floats(1.0, 1e3))


@given(models)
def test_the_three_lines_of_equation_3_agree(model):
    na = model.n * model.a
    assert (1 + na) / (1 + na / model.n_go) == pytest.approx(model.gamma)
    assert (1 + 1 / na) / (1 / na + 1 / model.n_go) == pytest.approx(model.gamma)
