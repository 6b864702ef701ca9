"""Beams from points, against those of simulated and real sensors."""

import numpy as np
import pytest

from modt.geometry import rotation_zyx
from modt.sensor_fit.beams import find_beams
from modt.sources.scan_file import read_scan
from modt_desk.simulation.sensors import sensor
from tests.sensor_fit.recordings import recording

SENSORS = ("vlp-16", "vlp-32c", "hdl-64e", "os1-64", "pandar64", "solid-state")


def agree(found_deg, true_deg) -> None:
    """The number within 5 %; the elevations within 0.1 degrees or a quarter of the spacing, for 95 % of the beams."""
    true_deg = np.sort(true_deg)
    assert len(found_deg) == pytest.approx(len(true_deg), rel=0.05)
    error_deg = np.abs(found_deg[:, None] - true_deg).min(axis=0)
    assert (error_deg < np.maximum(0.1, np.gradient(true_deg) / 4)).mean() >= 0.95


@pytest.mark.parametrize("name", SENSORS)
def test_beams_of_a_sensor_are_found(name):
    found, model = find_beams(recording(name).sweeps), sensor(name)
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


def test_a_sensor_without_beams_has_the_spacing_of_its_returns():
    found = find_beams(recording("mid-360").sweeps)
    assert len(found.elevations_deg) == 0
    assert found.spacing_deg == found.azimuth_step_deg == pytest.approx(1.03, rel=0.1)


def test_few_points_tell_nothing():
    assert find_beams([recording("vlp-16").sweeps[0][:500]]) is None


@pytest.mark.kitti
def test_beams_of_kitti(drive_0005):
    files = sorted((drive_0005 / "velodyne_points" / "data").glob("*.bin"))
    agree(find_beams([read_scan(f)[0] for f in files[:150:15]]).elevations_deg, rings_deg(read_scan(files[0])[0]))


@pytest.mark.kitti
def test_beams_of_a_pandar64_on_the_road(kitti_root):
    calibration = kitti_root / "packets" / "calibration" / "Pandar64.csv"
    true_deg = np.loadtxt(calibration, delimiter=",", skiprows=1)[:, 1]
    scans = sorted((kitti_root / "pandaset_002" / "scans").glob("*.bin"))[::4]
    agree(find_beams([read_scan(scan)[0] for scan in scans]).elevations_deg, true_deg)


def rings_deg(points):
    """Elevation of each ring of a KITTI scan, which lists them one by one, from straight ahead to the left."""
    azimuth = np.arctan2(points[:, 1], points[:, 0])
    start = (azimuth[1:] >= 0) & (azimuth[:-1] < 0) & (np.diff(azimuth) < 1)
    ring = np.append(0, np.cumsum(start))
    lines = [np.hypot(*points[ring == k, :2].T) for k in range(ring[-1] + 1)]
    slopes = [np.polyfit(r, points[ring == k, 2], 1)[0] for k, r in enumerate(lines)]
    return np.rad2deg(np.arctan(slopes))
