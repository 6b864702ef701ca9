"""Scan files, valid and invalid."""

import os
import re

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from modt.errors import ScanError
from modt.sources.scan_file import read_scan
from modt.types import UNRECORDED

GOOD = np.array([[1, 2, 3, 0.5], [4, 5, 6, 0.25]], np.float32)


def write(path, points):
    path.write_bytes(np.ascontiguousarray(points, np.float32).tobytes())
    return path


LOST = r"points are not finite and count as no return"
UNLIT = r"reflectances are not finite .*driver"
FLAWS = {  # rows and columns that are overwritten, the value, the expected reflectance, None for no return, flaws
    "none": ([], [], 0, 0, []),
    **{
        f"{value} at {column}": ([0], [column], value, None, [f"1 {LOST}"])
        for value in (np.nan, np.inf, -np.inf)
        for column in range(3)
    },
    "two that cancel": ([0, 1], [0], [[np.inf], [-np.inf]], None, [f"2 {LOST}"]),
    **{f"reflectance {v}": ([4, 5], [3], v, UNRECORDED, [f"2 {UNLIT}"]) for v in (np.nan, np.inf, -np.inf)},
    "no reflectance": (range(200), [3], np.nan, UNRECORDED, [f"200 {UNLIT}"]),
    "both": ([4], [0, 3], np.nan, None, [f"1 {LOST}"]),
    "negative reflectance": ([7], [3], -0.2, UNRECORDED, []),
    "unrecorded": (range(2, 200), [3], UNRECORDED, UNRECORDED, []),
    "beyond any range": ([7], [1], 3e38, None, []),
}


@pytest.mark.parametrize("scale", [1, 255])
@pytest.mark.parametrize("flaw", FLAWS)
def test_single_points_are_mended_and_the_others_unchanged(tmp_path, flaw, scale):
    """Reflectance from 0 to 255 is scaled to 0 to 1; a point without a place is at the origin."""
    rows, columns, value, mended, flaws = FLAWS[flaw]
    expected = np.tile(GOOD, (100, 1))
    scan = expected * np.float32([1, 1, 1, scale])
    scan[np.ix_(rows, columns)] = value
    expected[np.ix_(rows, range(4) if mended is None else [3])] = mended or 0
    points, named = read_scan(write(tmp_path / "0.bin", scan))
    assert points.dtype == np.float32
    np.testing.assert_allclose(points, expected, rtol=1e-6)
    assert len(named) == len(flaws)
    assert all(re.search(wanted, name) for wanted, name in zip(flaws, named, strict=True))


def test_an_outlier_does_not_rescale_the_others(tmp_path):
    scan = np.tile(np.float32([9, 1, -1, 0.5]), (1000, 1))
    scan[7, 3] = 1.5
    points, _ = read_scan(write(tmp_path / "0.bin", scan))
    scan[7, 3] = 1.0
    np.testing.assert_array_equal(points, scan)


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
    with pytest.raises(ScanError, match="cannot be read"):
        read_scan(tmp_path / "none.bin")


@pytest.mark.slow
def test_a_file_that_no_sweep_fills_is_refused_unread(tmp_path):
    path = tmp_path / "0.bin"
    path.touch()
    os.truncate(path, 2**40)
    with pytest.raises(ScanError, match="larger than 256 MiB"):
        read_scan(path)


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


def test_the_fifth_column_of_nuscenes_is_ignored(tmp_path):
    rows = np.array([[1, 2, 3, 51, 7], [4, 5, 6, 255, 31]] * 8, np.float32)
    path = tmp_path / "n015__LIDAR_TOP__1532402927647951.pcd.bin"
    path.write_bytes(rows.tobytes())  # 16 rows of 5, which would be 20 rows of 4
    points, _ = read_scan(path)
    ahead_left = np.stack([rows[:, 1], -rows[:, 0]], axis=1)  # from x to the right, y forward
    assert points == pytest.approx(np.hstack([ahead_left, rows[:, 2:4] / [1, 255]]))
