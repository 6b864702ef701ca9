"""Beams from points, against those of simulated and real sensors; their filters, against SciPy's."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal
from scipy import ndimage
from scipy.signal import find_peaks

from modt.geometry import rotation_zyx
from modt.sensor_fit.beams import find_beams, gaussian, prominent_peaks, running_mean
from modt.sources.scan_file import read_scan
from modt_simulation.sensors import sensor
from tests.sensor_fit.recordings import recording

SENSORS = ("vlp-16", "vlp-32c", "hdl-64e", "os1-64", "pandar64", "solid-state")


def agree(found_deg, true_deg):
    """The number within 5 %; the elevations within 0.1 degrees or a quarter of the spacing, for 95 % of the beams."""
    true_deg = np.sort(true_deg)
    assert len(found_deg) == pytest.approx(len(true_deg), rel=0.05)
    error_deg = np.abs(found_deg[:, None] - true_deg).min(axis=0)
    assert (error_deg < np.maximum(0.1, np.gradient(true_deg) / 4)).mean() >= 0.95


@pytest.mark.slow
@pytest.mark.parametrize("name", SENSORS)
def test_beams_of_a_sensor_are_found(name):
    found = find_beams(recording(name).sweeps)
    model = sensor(name)
    agree(found.elevations_deg, np.rad2deg(model.elevation_rad))
    assert found.azimuth_step_deg == pytest.approx(np.rad2deg(np.diff(model.azimuth_rad).mean()), rel=0.02)


def test_beams_are_found_in_sweeps_that_are_blurred_by_compensation_for_motion():
    blurred = []
    for points in recording("pandar64").sweeps:
        part = np.arctan2(points[:, 1], points[:, 0])
        moved = points.copy()
        for k in range(16):
            rows = np.flatnonzero((part + np.pi) // (np.pi / 8) == k)
            R = rotation_zyx(0.0, 0.0006 * (k / 15 - 0.5), 0.002 * k)
            moved[rows, :3] = points[rows, :3] @ R.T + [0.02 * k, 0.0, 0.0]
        blurred.append(moved.astype(np.float32))
    agree(find_beams(blurred).elevations_deg, np.rad2deg(sensor("pandar64").elevation_rad))


@pytest.mark.slow
def test_a_sensor_without_beams_has_the_spacing_of_its_returns():
    found = find_beams(recording("mid-360").sweeps)
    assert len(found.elevations_deg) == 0
    assert found.spacing_deg == found.azimuth_step_deg == pytest.approx(1.03, rel=0.1)


@pytest.mark.kitti
def test_beams_of_a_pandar64_on_the_road(kitti_root):
    calibration = kitti_root / "packets" / "calibration" / "Pandar64.csv"
    true_deg = np.loadtxt(calibration, delimiter=",", skiprows=1)[:, 1]
    scans = sorted((kitti_root / "pandaset_002" / "scans").glob("*.bin"))[::4]
    agree(find_beams([read_scan(scan)[0] for scan in scans]).elevations_deg, true_deg)


ROWS = st.lists(st.integers(0, 5000), min_size=1, max_size=600).map(np.array)


@given(ROWS, st.sampled_from([0.7, 1.0, 2.0]), st.integers(1, 260))
def test_filters_are_those_of_scipy(values, deviation, width):
    values = values / 7
    near = {"rtol": 1e-9, "atol": 1e-9}
    assert_allclose(gaussian(values, deviation), ndimage.gaussian_filter1d(values, deviation), **near)
    assert_allclose(running_mean(values, width), ndimage.uniform_filter1d(values, width), **near)


@pytest.mark.parametrize("smooth", [0, 2, 10])
@given(st.lists(st.integers(0, 20), min_size=1, max_size=500))
def test_peaks_and_prominences_are_those_of_scipy(smooth, count):
    count = ndimage.gaussian_filter1d(np.array(count, float), smooth) if smooth else np.array(count, float)
    peaks, prominence = prominent_peaks(count)
    expected, shape = find_peaks(count, prominence=0)
    assert_array_equal(peaks, expected)
    assert_allclose(prominence, shape["prominences"])
