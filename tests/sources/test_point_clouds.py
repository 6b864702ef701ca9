"""PCD and PLY files."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from modt.errors import ScanError
from modt.ros2.point_cloud2 import read_cloud
from modt.sources.point_cloud_file import decompress
from modt.sources.recognise import open_scans
from modt.sources.scan_file import read_scan
from modt.types import UNRECORDED
from tests.ros2 import messages
from tests.sources.point_clouds import pcd, ply, table

WRITERS = {
    f"{write.__name__} {data}": (write, data)
    for write, kinds in (
        (pcd, ("ascii", "binary", "binary_compressed")),
        (ply, ("ascii", "binary_little_endian", "binary_big_endian")),
    )
    for data in kinds
}

XYZ = dict.fromkeys("xyz", "f4")
"""Columns of coordinates, and their values in a table that begins with them."""
XYZ_OF_TABLE = np.arange(5)[:, None] + [0, 1, 2]


def read(path, raw):
    path.write_bytes(raw)
    return read_scan(path)


@pytest.fixture(params=WRITERS)
def form(request, tmp_path):
    """A function that writes rows and reads them again."""
    write, data = WRITERS[request.param]
    return lambda rows: read(tmp_path / f"scan.{write.__name__}", write(rows, data))


def test_an_ascii_ply_may_have_lists_before_and_after_its_numbers(tmp_path):
    text = """ply
format ascii 1.0
element face 2
property list uchar int vertex_indices
element vertex 2
property float x
property float y
property float z
property float scalar_Intensity
property list uint float64 descriptor
element face 1
property list uchar int vertex_indices
end_header
3 0 1 2
4 0 1 2 3

1.5 2 3 51 2 0.5 0.25
4 5 6 102 0
3 0 1 2
"""
    points, _ = read(tmp_path / "scan.ply", text.encode())
    assert points == pytest.approx(np.array([[1.5, 2, 3, 0.2], [4, 5, 6, 0.4]]))


def test_a_pcd_of_padded_memory_is_read(tmp_path):
    rows = table(**XYZ, gap="u4", intensity="f4", ring="u2", rest="u4")
    head = {"FIELDS": "x y z _ intensity ring _", "SIZE": "4 4 4 1 4 2 1", "TYPE": "F F F U F U U"}
    points, _ = read(tmp_path / "scan.pcd", pcd(rows, **head, COUNT="1 1 1 4 1 1 4"))
    assert_allclose(points[:, :3], XYZ_OF_TABLE)
    assert_allclose(points[:, 3], rows["intensity"] / 255, atol=1e-6)


def test_columns_of_any_order_and_type(form):
    points, flaws = form(table(ring="u2", z="f8", time="f4", reflectivity="u2", x="f8", intensity="f4", y="f4"))
    assert (points.dtype, flaws) == (np.float32, [])
    assert_allclose(points[:, :3], np.arange(5)[:, None] + [4, 6, 1])
    assert_allclose(points[:, 3], (50 * np.arange(5) + 3) / 255, atol=1e-7)


@pytest.mark.parametrize(
    ("kind", "values", "reflectance"),
    [
        ("u1", [0, 1, 0, 1, 0], [0, 1 / 255, 0, 1 / 255, 0]),
        ("u2", [0, 255, 65_535, 0, 0], [0, 255 / 65_535, 1, 0, 0]),
        ("f4", [0, 0.5, 1, 0, 0], [0, 0.5, 1, 0, 0]),
        ("f4", [0, 51, 255, 102, 51], [0, 0.2, 1, 0.4, 0.2]),
        ("f4", [0, 51, 4000, 102, 51], [UNRECORDED] * 5),
    ],
)
def test_reflectance_is_scaled(form, kind, values, reflectance):
    rows = table(**XYZ, i=kind)
    rows["i"] = values
    assert_allclose(form(rows)[0][:, 3], reflectance, atol=1e-6)


NAMES = [("I",), ("Scalar_field_intensity",), ("scalar_Scalar_field_Reflectance",), ("remissions",)]
NAMES += [("scalar_Intensity", "scalar_Reflectance")]  # a calibrated one goes before an intensity


@pytest.mark.parametrize("names", NAMES)
def test_reflectance_is_recognised_by_its_usual_names(form, names):
    rows = table(**{**XYZ, "scalar_Time": "f4", **dict.fromkeys(names, "u1")})
    cloud = read_cloud(messages.encode(messages.cloud(rows[None])))
    for points in (form(rows)[0], cloud.points):
        assert_allclose(points[:, 3], rows[names[-1]] / 255, atol=1e-6)


def test_fields_of_no_numbers_hold_no_bytes(tmp_path):
    rows = table(**XYZ, i="u1")
    head = {"FIELDS": "x _ y z i i _", "SIZE": "4 1 4 4 2 1 8", "TYPE": "F U F F U U F", "COUNT": "1 0 1 1 0 1 0"}
    for data in ("binary", "ascii", "binary_compressed"):
        points, flaws = read(tmp_path / "scan.pcd", pcd(rows, data, **head))
        assert_allclose(points[:, :3], XYZ_OF_TABLE)
        assert_allclose(points[:, 3], rows["i"] / 255, atol=1e-6)
        assert flaws == []


def test_without_reflectance_none_is_recorded(form):
    assert (form(table(**XYZ))[0][:, 3] == UNRECORDED).all()


ROWS = table(**XYZ, i="u1")


@pytest.mark.parametrize(
    ("name", "raw", "cause"),
    [
        ("a.pcd", b"nothing", "no header"),
        ("a.pcd", pcd(ROWS, POINTS=10**18), "1000000000000000000 points"),
        ("a.pcd", pcd(ROWS, COUNT="1 1 1 1000000000"), "i of COUNT 1000000000"),
        ("a.pcd", pcd(ROWS, COUNT="0 1 1 1"), "no column x"),
        ("a.pcd", pcd(ROWS, SIZE="4 4 4 3"), "lacks a line, or one is broken"),
        ("a.pcd", pcd(ROWS, "zipped"), "DATA 'zipped' is unknown"),
        ("a.pcd", pcd(ROWS)[:-1], "truncated: 64 bytes for 5 points"),
        ("a.pcd", pcd(ROWS, "ascii")[:-6], "truncated: 19 numbers"),
        ("a.pcd", pcd(ROWS, "ascii").replace(b"4.0", b"4.o"), "no number"),
        ("a.pcd", pcd(ROWS, "binary_compressed", POINTS=4_000_000), "of another size"),
        ("a.ply", b"nothing", "no header"),
        ("a.ply", ply(ROWS, n=10**15), "promises"),
        ("a.ply", ply(ROWS, "binary"), "cannot be read"),
        ("a.ply", ply(ROWS, before="element face 1\nproperty list uchar int n\n"), "lists"),
        ("a.ply", ply(ROWS)[:-1], "truncated"),
    ],
)
def test_a_hostile_or_broken_file_is_one_clear_error(tmp_path, name, raw, cause):
    with pytest.raises(ScanError, match=cause):
        read(tmp_path / name, raw)


def test_lzf_repeats():
    # "abc", then 7 bytes from 3 before, then 262 + 2 bytes from 1 before
    packed = b"\x02abc" + bytes([5 << 5, 2]) + bytes([7 << 5, 255, 0])
    assert decompress(packed, 274) == b"abc" + b"abcabca" + b"a" * 264


def seen(x_m, n=4000):
    """Points around a sensor that stands at x [m] in a world, in that world."""
    rng = np.random.default_rng(1)
    bearing = rng.uniform(-np.pi, np.pi, n)
    range_m = rng.uniform(2.0, 30.0, n)
    xyz = np.stack([range_m * np.cos(bearing) + x_m, range_m * np.sin(bearing), rng.uniform(-1, 1, n)], axis=1)
    rows = np.zeros(n, [("x", "f8"), ("y", "f8"), ("z", "f8"), ("intensity", "f4")])
    rows["x"], rows["y"], rows["z"] = xyz.T
    return rows


@pytest.mark.parametrize("in_world", [True, False])
@pytest.mark.parametrize("origin_m", [0.0, 4.5e6])
def test_the_viewpoint_is_the_pose_whatever_the_frame_of_the_points(tmp_path, in_world, origin_m):
    for k in range(4):
        x_m = origin_m + 5.0 * k
        rows = seen(x_m if in_world else 0.0)
        (tmp_path / f"{k:06d}.pcd").write_bytes(pcd(rows, VIEWPOINT=f"{x_m} 0 0 1 0 0 0"))
    stream = open_scans(tmp_path)
    frames = list(stream)
    assert [frame.T_world_sensor[0, 3] - origin_m for frame in frames] == pytest.approx([0, 5, 10, 15])
    for frame in frames:
        assert_allclose(frame.points[:, :3], frames[0].points[:, :3], atol=1e-4)
    assert np.median(np.abs(frames[3].points[:, 0])) < 20


def test_a_viewpoint_that_never_changes_is_a_mount_and_no_pose(tmp_path):
    for k in range(3):
        (tmp_path / f"{k:06d}.pcd").write_bytes(pcd(seen(0.0), VIEWPOINT="0 0 1.8 1 0 0 0"))
    stream = open_scans(tmp_path)
    assert not stream.info.has_poses
    assert [frame.T_world_sensor for frame in stream] == [None] * 3
