"""Least squares with coefficients of at least 0: no work gives energy back."""

from __future__ import annotations

import numpy as np
from scipy import linalg, optimize

from modt.types import Float64

_RIDGE = 1e-12
"""Added to the scaled normal equations, so that columns which vary together share their cost."""


def nonnegative_fit(gram: Float64, moment: Float64) -> Float64:
    """(p,) coefficients of at least 0, by (p, p) X^T X and (p,) X^T y of counts X; 0 of what was never counted."""
    value = np.zeros(len(moment))
    counted = np.diag(gram) > 0
    if counted.any():
        scale = np.sqrt(np.diag(gram)[counted])
        normal = gram[np.ix_(counted, counted)] / np.outer(scale, scale) + _RIDGE * np.eye(len(scale))
        lower = np.linalg.cholesky(normal)
        target = linalg.solve_triangular(lower, moment[counted] / scale, lower=True)
        value[counted] = optimize.nnls(lower.T, target)[0] / scale
    return value
