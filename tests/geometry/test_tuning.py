"""Tuning of the comparison of k-DOPs: every value takes effect, in NumPy and in C alike."""

from dataclasses import fields, replace

import numpy as np
import pytest

from modt.geometry.kdop import Shapes
from modt.geometry.kernels import GeometryKernels
from modt.geometry.native_kernels import NativeGeometryKernels
from modt.geometry.tuning import ShapeTuning
from modt.native.library import NotAvailableError, load
from tests.geometry.test_kdop import WEIGHTS, random_pairs, random_sights


def compared(kernels):
    """All that kernels compare of some k-DOPs."""
    a, b, covariance, variance, pairs = random_pairs(0, 6)
    shapes = (Shapes.of(s.kdop, s.bottom, s.top, np.ones(6, np.int64), kernels.shape_tuning) for s in (a, b))
    sight = random_sights(np.random.default_rng(1), 6) * np.tile([0.0, 1.0], 3)  # every second near end is not known
    before = np.tile([0.02, 0.02, 0.0, 0.0, 0.0, 0.0], (4, 1))
    results = (
        kernels.coverage(a.kdop, b.kdop, *pairs),
        *kernels.pair_costs(*shapes, covariance, variance, pairs, WEIGHTS),
        *kernels.measured(a.kdop, b.kdop, sight, 0.01, before),
    )
    return np.concatenate([result.ravel() for result in results])


@pytest.mark.parametrize("name", [field.name for field in fields(ShapeTuning)])
def test_every_value_takes_effect_in_numpy_and_in_c(name):
    tuning = replace(ShapeTuning(), **{name: 0.8 * getattr(ShapeTuning(), name)})
    changed = compared(GeometryKernels(tuning))
    assert (changed != compared(GeometryKernels())).any()
    try:
        library, _ = load()
    except NotAvailableError as error:
        pytest.skip(str(error))
    np.testing.assert_array_equal(changed, compared(NativeGeometryKernels(library, tuning)))
