"""Peaks, against SciPy's."""

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter1d
from scipy.signal import find_peaks

from modt.sensor_fit.beams import prominent_peaks


@pytest.mark.parametrize("seed", range(8))
@pytest.mark.parametrize("smooth", [0, 2, 10])
def test_peaks_and_prominences_are_those_of_scipy(seed, smooth):
    count = np.random.default_rng(seed).integers(0, 20, 500).astype(float)  # with plateaus
    if smooth:
        count = gaussian_filter1d(count, smooth)
    peaks, prominence = prominent_peaks(count)
    expected, shape = find_peaks(count, prominence=0)
    np.testing.assert_array_equal(peaks, expected)
    np.testing.assert_allclose(prominence, shape["prominences"])


@pytest.mark.parametrize("count", [[1.0], [1.0, 2.0], [3.0, 3.0, 3.0], [1.0, 2.0, 3.0]])
def test_without_a_peak_there_is_none(count):
    assert len(prominent_peaks(np.array(count))[0]) == 0
