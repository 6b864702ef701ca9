"""Least squares with coefficients of at least 0."""

import numpy as np
import pytest
from scipy import optimize

from modt_desk.energy.board_fit import nonnegative_fit


@pytest.mark.parametrize("true", [[2.0, 3.0, 1e-4], [2.0, -3.0, 1e-4], [-1.0, 3.0, -1.0]])
def test_it_is_the_bounded_solution_of_the_whole_problem(true: list[float]) -> None:
    random = np.random.default_rng(0)
    X = random.uniform(0, 1, (200, 3)) * [1, 10, 1000]
    y = X @ true + random.standard_normal(200)
    found = nonnegative_fit(X.T @ X, X.T @ y)
    np.testing.assert_allclose(found, optimize.nnls(X, y)[0], rtol=1e-6, atol=1e-9)
    assert (found >= 0).all()


def test_what_was_never_counted_costs_nothing() -> None:
    X = np.array([[1.0, 0.0], [2.0, 0.0]])
    np.testing.assert_allclose(nonnegative_fit(X.T @ X, X.T @ [3.0, 6.0]), [3.0, 0.0])
