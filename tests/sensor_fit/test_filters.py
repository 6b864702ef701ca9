"""Filters and peaks, against SciPy's; sums may round in another order."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import ndimage
from scipy.signal import find_peaks

from modt.sensor_fit.beams import gaussian, prominent_peaks, running_mean, running_median

ROWS = st.lists(st.integers(0, 5000), min_size=1, max_size=600).map(np.array)


@given(ROWS, st.sampled_from([0.7, 1.0, 2.0]), st.integers(1, 260), st.sampled_from([1, 3, 7]))
def test_filters_are_those_of_scipy(values, deviation, width, odd):
    padded = np.pad(values, odd // 2, "symmetric")  # SciPy of Python 3.10 fails where the window is the longer one
    median = np.median(np.lib.stride_tricks.sliding_window_view(padded, odd), axis=1)
    np.testing.assert_array_equal(running_median(values, odd), median)
    values, near = values / 7, {"rtol": 1e-9, "atol": 1e-9}
    np.testing.assert_allclose(gaussian(values, deviation), ndimage.gaussian_filter1d(values, deviation), **near)
    np.testing.assert_allclose(running_mean(values, width), ndimage.uniform_filter1d(values, width), **near)


@pytest.mark.parametrize("smooth", [0, 2, 10])
@given(st.lists(st.integers(0, 20), min_size=1, max_size=500))
def test_peaks_and_prominences_are_those_of_scipy(smooth, count):
    count = ndimage.gaussian_filter1d(np.array(count, float), smooth) if smooth else np.array(count, float)
    peaks, prominence = prominent_peaks(count)
    expected, shape = find_peaks(count, prominence=0)
    np.testing.assert_array_equal(peaks, expected)
    np.testing.assert_allclose(prominence, shape["prominences"])
