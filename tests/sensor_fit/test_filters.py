"""Filters against slow ones; sums may round in another order."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from scipy import ndimage

from modt.sensor_fit.beams import gaussian, running_mean, running_median

rows = st.lists(st.integers(0, 5000), min_size=1, max_size=600).map(np.array)


@given(rows, st.sampled_from([0.7, 1.0, 2.0]))
def test_gaussian(values, deviation):
    values = values / 7
    expected = ndimage.gaussian_filter1d(values, deviation)
    np.testing.assert_allclose(gaussian(values, deviation), expected, rtol=1e-9, atol=1e-9)


@given(rows, st.integers(1, 260))
def test_running_mean(values, width):
    values = values / 7
    expected = ndimage.uniform_filter1d(values, width)
    np.testing.assert_allclose(running_mean(values, width), expected, rtol=1e-9, atol=1e-9)


@given(rows, st.sampled_from([1, 3, 7]))
def test_running_median(values, width):
    padded = np.pad(
        values, width // 2, "symmetric"
    )  # older versions of SciPy fail where the window is the longer one
    expected = np.median(np.lib.stride_tricks.sliding_window_view(padded, width), axis=1)
    np.testing.assert_array_equal(running_median(values, width), expected)
