"""Scan files, valid and invalid."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from modt.errors import ScanError
from modt.sources.scan_file import read_scan, sanitised
from modt.types import UNRECORDED

GOOD = np.array([[1, 2, 3, 0.5], [4, 5, 6, 0.25]], np.float32)


def write(path, points):
    path.write_bytes(np.ascontiguousarray(points, np.float32).tobytes())
    return path


def test_a_valid_scan_is_unchanged(tmp_path):
    points, flaws = read_scan(write(tmp_path / "0.bin", GOOD))
    assert flaws == []
    assert points.dtype == np.float32
    np.testing.assert_array_equal(points, GOOD)


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize("column", range(3))
def test_points_that_are_not_finite_are_set_to_the_origin(tmp_path, value, column):
    broken = GOOD.copy()
    broken[0, column] = value
    points, flaws = read_scan(write(tmp_path / "0.bin", broken))
    assert flaws == ["1 points are not finite and count as no return"]
    np.testing.assert_array_equal(points, [[0, 0, 0, 0], GOOD[1]])


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize("scale", [1, 255])
def test_a_reflectance_that_is_not_finite_counts_as_not_recorded(tmp_path, value, scale):
    scan = np.tile(GOOD, (4, 1)) * np.float32([1, 1, 1, scale])
    scan[:2, 3] = value
    scan[2, [0, 3]] = value
    points, flaws = read_scan(write(tmp_path / "0.bin", scan))
    mended = np.tile(GOOD, (4, 1))
    mended[:2, 3] = UNRECORDED
    mended[2] = 0.0
    np.testing.assert_array_equal(points, mended)
    lost, unlit = flaws
    assert lost.startswith("1 points are not finite")
    assert unlit.startswith("2 reflectances are not finite")
    assert "driver" in unlit


@pytest.mark.parametrize("value", [np.nan, UNRECORDED])
def test_the_scale_is_that_of_the_recorded_reflectances(tmp_path, value):
    scan = np.tile(GOOD, (100, 1)) * np.float32([1, 1, 1, 255])
    scan[2:, 3] = value
    points, _ = read_scan(write(tmp_path / "0.bin", scan))
    np.testing.assert_allclose(points[:2, 3], GOOD[:, 3])
    assert (points[2:, 3] == UNRECORDED).all()


@pytest.mark.parametrize("scale", [1, 255])
def test_a_negative_reflectance_counts_as_not_recorded(tmp_path, scale):
    scan = np.tile(GOOD, (100, 1)) * np.float32([1, 1, 1, scale])
    scan[7, 3] = -0.2
    points, _ = read_scan(write(tmp_path / "0.bin", scan))
    assert np.flatnonzero(points[:, 3] == UNRECORDED).tolist() == [7]


def test_a_scan_without_reflectances_keeps_its_points(tmp_path):
    scan = np.tile(GOOD, (100, 1))
    scan[:, 3] = np.nan
    points, flaws = read_scan(write(tmp_path / "0.bin", scan))
    np.testing.assert_array_equal(points[:, :3], scan[:, :3])
    assert (points[:, 3] == UNRECORDED).all()
    assert len(flaws) == 1


def test_reflectance_in_bytes_is_scaled(tmp_path):
    scan = GOOD.copy()
    scan[:, 3] = [255, 51]
    points, _ = read_scan(write(tmp_path / "0.bin", scan))
    np.testing.assert_allclose(points[:, 3], [1.0, 0.2])


@pytest.mark.parametrize(
    ("content", "cause"),
    [
        (b"", "empty"),
        (GOOD.tobytes()[:-3], "truncated"),
        (np.full((100, 4), 5e3, np.float32).tobytes(), "columns"),
        (np.tile(np.float32([1, 2, -3]), 400).tobytes(), "columns"),
    ],
    ids=["empty", "truncated", "far", "three columns"],
)
def test_an_invalid_scan_is_refused_with_its_cause(tmp_path, content, cause):
    path = tmp_path / "0.bin"
    path.write_bytes(content)
    with pytest.raises(ScanError, match=cause) as caught:
        read_scan(path)
    assert str(path) in str(caught.value)


@pytest.mark.slow
def test_a_file_that_no_sweep_fills_is_refused_unread(tmp_path):
    path = tmp_path / "0.bin"
    with path.open("wb") as file:
        file.truncate(2**40)
    with pytest.raises(ScanError, match="larger than 256 MiB"):
        read_scan(path)


def test_a_missing_scan_is_an_error_of_that_scan(tmp_path):
    with pytest.raises(ScanError, match="cannot be read"):
        read_scan(tmp_path / "none.bin")


@given(st.binary(max_size=400))
@pytest.mark.filterwarnings("ignore::RuntimeWarning")
def test_any_bytes_are_finite_points_or_an_error(tmp_path_factory, content):
    path = tmp_path_factory.getbasetemp() / "fuzz.bin"
    path.write_bytes(content)
    try:
        points, flaws = read_scan(path)
    except ScanError:
        return
    assert len(points) == len(content) // 16
    assert len(flaws) <= 2
    assert np.isfinite(points).all()
    assert ((points[:, 3] >= 0) | (points[:, 3] == UNRECORDED)).mean() >= 0.98


def test_two_infinities_that_cancel_are_detected():
    points = GOOD.copy()
    points[:, 0] = [np.inf, -np.inf]
    with np.errstate(invalid="ignore"):
        clean, (lost,) = sanitised(points, "scan")
    assert lost.startswith("2 points")
    assert np.isfinite(clean).all()


def test_an_outlier_does_not_rescale_the_others(tmp_path):
    scan = np.zeros((1000, 4), np.float32)
    scan[:, 3] = np.linspace(0, 1, 1000)
    scan[7, 3] = 1.5
    path = tmp_path / "scan.bin"
    scan.tofile(path)
    points, _ = read_scan(path)
    np.testing.assert_allclose(np.delete(points[:, 3], 7), np.delete(scan[:, 3], 7))
    assert points[7, 3] == 1.0


def test_a_few_points_beyond_any_range_are_no_return(tmp_path):
    points = np.tile(np.array([9.0, 1.0, -1.0, 0.5], np.float32), (200, 1))
    points[7, 1] = 3e38
    path = tmp_path / "a.bin"
    path.write_bytes(points.tobytes())
    read, flaws = read_scan(path)
    assert read[7].tolist() == [0.0, 0.0, 0.0, 0.0]
    assert np.array_equal(read[:7], points[:7])
    assert flaws == []


def test_a_scan_of_nuscenes_has_a_fifth_column(tmp_path):
    rows = np.array([[1, 2, 3, 51, 7], [4, 5, 6, 255, 31]] * 8, np.float32)
    path = tmp_path / "n015__LIDAR_TOP__1532402927647951.pcd.bin"
    path.write_bytes(rows.tobytes())  # 16 rows of 5, which would be 20 rows of 4
    points, _ = read_scan(path)
    assert points == pytest.approx(rows[:, :4] / [1, 1, 1, 255])
