import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from modt.energy.prediction import PaperModel, gamma

PAPER = PaperModel(e_seg=31.0, e_class=6.5, n_obj=4.0, n_bg=36.0, n_go=34.9)

positive = st.floats(1e-3, 1e3)
models = st.builds(
    PaperModel, e_seg=positive, e_class=positive, n_obj=positive, n_bg=positive, n_go=st.floats(1.0, 1e3)
)


def test_energies_of_a_worked_example() -> None:
    assert PAPER.e1(10) == pytest.approx(10 * 31 + 10 * 40 * 6.5)
    assert PAPER.e2(10) == pytest.approx(10 * 31 + 10 / 34.9 * 40 * 6.5)
    assert PAPER.gamma == pytest.approx(291 / (31 + 260 / 34.9))


@given(models, st.integers(1, 10**6))
def test_the_three_lines_of_equation_3_agree(model: PaperModel, frames: int) -> None:
    n = model.n_obj + model.n_bg
    inverse = 1 / (n * model.a)
    assert model.e1(frames) / model.e2(frames) == pytest.approx(model.gamma)
    assert gamma(model.a, n, model.n_go) == pytest.approx(model.gamma)
    assert (1 + inverse) / (inverse + 1 / model.n_go) == pytest.approx(model.gamma)


@given(models)
def test_saving_lies_between_nothing_and_the_life_of_a_track(model: PaperModel) -> None:
    assert 1.0 - 1e-12 <= model.gamma <= model.n_go * (1 + 1e-12)
    assert model.short_form_error >= -1e-12


def test_short_form_is_the_limit_of_dear_classification() -> None:
    model = PaperModel(e_seg=1e-9, e_class=1.0, n_obj=4, n_bg=36, n_go=20)
    assert model.gamma == pytest.approx(model.gamma_short)
    assert model.short_form_error == pytest.approx(0, abs=1e-6)


def test_nothing_costs_nothing_saves_nothing() -> None:
    model = PaperModel(e_seg=0.0, e_class=0.0, n_obj=0, n_bg=0, n_go=5)
    assert model.gamma == 1.0
    assert math.isinf(model.a)
