import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from modt_desk.energy.savings import EnergyModel

PAPER = EnergyModel(e_seg=31.0, e_class=6.5, n=40.0, n_go=34.9)

positive = st.floats(1e-3, 1e3)
models = st.builds(EnergyModel, e_seg=positive, e_class=positive, n=positive, n_go=st.floats(1.0, 1e3))


def test_energies_of_a_worked_example() -> None:
    assert PAPER.e1 == pytest.approx(31 + 40 * 6.5)
    assert PAPER.e2 == pytest.approx(31 + 40 * 6.5 / 34.9)
    assert PAPER.gamma == pytest.approx(291 / (31 + 260 / 34.9))


@given(models)
def test_the_three_lines_of_equation_3_agree(model: EnergyModel) -> None:
    na = model.n * model.a
    assert (1 + na) / (1 + na / model.n_go) == pytest.approx(model.gamma)
    assert (1 + 1 / na) / (1 / na + 1 / model.n_go) == pytest.approx(model.gamma)


@given(models)
def test_gamma_lies_between_one_and_the_life_of_a_track(model: EnergyModel) -> None:
    assert 1.0 - 1e-12 <= model.gamma <= model.n_go * (1 + 1e-12)
    assert model.short_form_error >= -1e-12


def test_without_costs_there_is_no_saving() -> None:
    model = EnergyModel(e_seg=0.0, e_class=0.0, n=0, n_go=5)
    assert model.gamma == 1.0
    assert math.isinf(model.a)
