"""PointCloud2 messages of any layout, compared with a simple reader, and hostile messages."""

import dataclasses

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

from modt.ros2.cdr import MessageError
from modt.ros2.point_cloud2 import read_cloud, turn_of, write_cloud
from modt.types import UNRECORDED
from tests.ros2 import messages

KINDS = ["i1", "u1", "i2", "u2", "i4", "u4", "f4", "f8"]


@st.composite
def tables(draw):
    """Structured points: the fields in any order, of any type, with gaps, in either byte order."""
    order = draw(st.sampled_from("<>"))
    others = st.dictionaries(st.sampled_from(["ring", "intensity", "rgb", "range"]), st.sampled_from(KINDS))
    kinds = {name: draw(st.sampled_from(["f4", "f8"])) for name in "xyz"} | draw(others)
    names = draw(st.permutations(sorted(kinds)))
    offsets = []
    end = 0
    for name in names:
        offsets.append(end + draw(st.integers(0, 5)))
        end = offsets[-1] + np.dtype(kinds[name]).itemsize
    formats = [order + kinds[name] for name in names]
    itemsize = end + draw(st.integers(0, 5))
    layout = np.dtype({"names": names, "formats": formats, "offsets": offsets, "itemsize": itemsize})
    shape = draw(st.integers(1, 3)), draw(st.integers(1, 40))
    points = np.zeros(shape, layout)
    rng = np.random.default_rng(draw(st.integers(0, 1000)))
    for name in names:
        points[name] = rng.uniform(0, 1 if kinds[name][0] == "f" else 100, shape)
    points[draw(st.sampled_from("xyz"))][0, 0] = draw(st.sampled_from([0.5, np.nan, np.inf]))
    return points


@given(points=tables(), padding=st.integers(0, 7), little=st.booleans())
def test_any_layout_is_read_as_point_by_point(points, padding, little):
    raw = messages.encode(messages.cloud(points, padding=padding), little=little)
    cloud = read_cloud(raw)
    expected = np.array([[point[name] for name in "xyz"] for point in points.reshape(-1)], np.float32)
    expected[~np.isfinite(expected).all(axis=1)] = 0.0  # no return
    assert_array_equal(cloud.points[:, :3], expected)
    assert (cloud.stamp_s, cloud.frame_id) == (1.0, "lidar")
    assert cloud.points.dtype == np.float32
    assert cloud.points.flags.writeable
    if "intensity" not in points.dtype.names:
        assert (cloud.points[:, 3] == UNRECORDED).all()
    else:
        assert cloud.points[:, 3].min() >= 0
        assert cloud.points[:, 3].max() <= 1


@pytest.mark.parametrize(
    ("kind", "values", "expected"),
    [
        ("f4", np.linspace(0, 1, 100), np.linspace(0, 1, 100)),
        ("f4", np.linspace(0, 255, 100), np.linspace(0, 1, 100)),
        ("u1", np.arange(0, 250, 2.5).astype(int), np.arange(0, 250, 2.5).astype(int) / 255),
        ("u2", np.arange(100), np.arange(100) / 255),
        ("u2", np.arange(100) * 600, np.arange(100) * 600 / 65535),
        ("f4", np.where(np.arange(100) == 7, 3.0, 0.5), np.where(np.arange(100) == 7, 1.0, 0.5)),
    ],
)
def test_reflectances_are_scaled_by_what_they_span(kind, values, expected):
    points = messages.xyzi(100, [*messages.XYZ, ("intensity", kind)])
    points["intensity"] = values
    assert_allclose(read_cloud(messages.encode(messages.cloud(points))).points[:, 3], expected, atol=1e-6)


@pytest.mark.parametrize(
    ("changes", "reason"),
    [
        ({"height": 2**32 - 1, "width": 2**32 - 1}, "malformed"),
        ({"width": 21}, "malformed"),
        ({"point_step": 2**31}, "malformed"),
        ({"point_step": 0}, "fields"),
        ({"height": 2, "width": 9, "row_step": 3}, "malformed"),
        ({"width": 0}, "empty"),
        ({"fields": []}, "fields"),
    ],
)
def test_sizes_that_do_not_fit_are_refused(changes, reason):
    message = dataclasses.replace(messages.cloud(messages.xyzi(20)), **changes)
    with pytest.raises(MessageError) as caught:
        read_cloud(messages.encode(message))
    assert caught.value.reason == reason


def test_a_written_cloud_is_read_by_another_implementation():
    points = np.random.default_rng(0).uniform(0, 1, (30, 4)).astype(np.float32)
    message = messages.decode(write_cloud(12.5, "lidar", points), "sensor_msgs/msg/PointCloud2")
    assert (message.header.stamp.sec, message.header.stamp.nanosec) == (12, 500_000_000)
    assert [field.name for field in message.fields] == ["x", "y", "z", "intensity"]
    assert (message.height, message.width, message.point_step, message.row_step) == (1, 30, 16, 480)
    assert_array_equal(message.data.view(np.float32).reshape(-1, 4), points)
    assert_array_equal(read_cloud(write_cloud(12.5, "lidar", points)).points, points)
    assert len(messages.decode(write_cloud(12.5, "lidar", points[:0]), "sensor_msgs/msg/PointCloud2").data) == 0


def turning(*, turn_s=0.1, seam=np.pi, field="time", kind="f4", unit=1e-9, begin=0.0, wild=None):
    """Points all round by a head that turns clockwise once, seen `turn_s / 2` before to after straight ahead.

    The time of one of them may be `wild`.
    """
    bearing = np.linspace(-np.pi, np.pi, 2000, endpoint=False)
    points = np.zeros((1, 2000), [*messages.XYZI, (field, kind)])
    points["x"] = 10 * np.cos(bearing)
    points["y"] = 10 * np.sin(bearing)
    since_seam = np.mod(seam - bearing, 2 * np.pi) if turn_s > 0 else np.mod(bearing - seam, 2 * np.pi)
    points[field] = (begin + abs(turn_s) * since_seam / (2 * np.pi)) / unit
    if wild is not None:
        points[field][0, 77] = wild
    return read_cloud(messages.encode(messages.cloud(points, stamp_s=1000.0)))


@pytest.mark.parametrize("turn_s", [0.1, -0.1, 0.05])
@pytest.mark.parametrize(("kind", "unit"), [("f4", 1.0), ("u4", 1e-9), ("u4", 1e-6), ("f4", 1e-3)])
def test_a_turn_is_known_by_the_times_of_its_points(turn_s, kind, unit):
    cloud = turning(turn_s=turn_s, kind=kind, unit=unit)
    assert cloud.turn_s == pytest.approx(turn_s, rel=1e-2)
    assert cloud.stamp_s == pytest.approx(1000.0 + abs(turn_s) / 2, abs=1e-3)


@pytest.mark.parametrize("field", ["t", "time_stamp", "offset_time", "point_time_offset", "stamps"])
def test_the_field_of_the_times_of_points_has_many_names(field):
    assert turning(field=field, kind="u4").turn_s == pytest.approx(0.1, rel=1e-2)


@pytest.mark.parametrize("unit", [1.0, 1e-3, 1e-9])
def test_times_on_the_clock_of_the_header_are_not_added_to_it(unit):
    cloud = turning(field="timestamp", kind="f8", unit=unit, begin=1000.0)
    assert cloud.stamp_s == pytest.approx(1000.05, abs=1e-3)


def test_bearings_that_fit_no_turn_at_all_are_of_no_head():
    rng = np.random.default_rng(3)
    bearing = rng.choice([0, 0, 1, 2, 3], 100) * rng.uniform(0.5, 3)
    points = np.zeros((100, 4), np.float32)
    points[:, 0] = 5 * np.cos(bearing)
    points[:, 1] = 5 * np.sin(bearing)
    turn = turn_of(points, np.linspace(0, 0.1, 100))
    assert (turn.turn_s, turn.mid_s) == (0.0, pytest.approx(0.05))


@pytest.mark.parametrize(("kind", "unit", "begin"), [("u4", 1e-9, 0.0), ("f8", 1e-9, 1000.0), ("f4", 1.0, -0.1)])
def test_a_sensor_without_a_head_is_stamped_in_the_middle_of_its_times_and_each_point_has_its_delay(
    kind, unit, begin
):
    rng = np.random.default_rng(5)
    since_s = np.linspace(0.0, 0.1, 2000)
    points = np.zeros((1, 2000), [*messages.XYZ, ("timestamp", kind)])
    points["x"], points["y"] = rng.uniform(-20, 20, (2, 1, 2000))
    points["timestamp"] = (begin + since_s) / unit
    if kind[0] == "f":
        points["timestamp"][0, 7] = np.nan
    cloud = read_cloud(messages.encode(messages.cloud(points, stamp_s=1000.0)))
    middle_s = 1000.05 + min(begin, 0.0)
    assert (cloud.turn_s, cloud.stamp_s) == (0.0, pytest.approx(middle_s, abs=2e-4))
    wild = np.isnan(points["timestamp"].reshape(-1).astype(float))
    delay_s = np.where(wild, 0.0, since_s - 0.05)
    assert_allclose(cloud.delay_s, delay_s, atol=2e-4)


@pytest.mark.parametrize("odd", [{"turn_s": 3.0, "unit": 1.0}, {"turn_s": 0.0}])
def test_times_of_no_head_are_not_used(odd):
    cloud = turning(**odd)
    assert (cloud.turn_s, cloud.stamp_s) == (0.0, 1000.0)


@pytest.mark.parametrize("row_step", [0, 16, 16 * 40, 2**32 - 1])
def test_a_wrong_size_of_a_row_does_not_hide_dense_rows(row_step):
    points = messages.xyzi(40).reshape(4, 10)
    message = messages.cloud(points)
    cloud = read_cloud(messages.encode(dataclasses.replace(message, row_step=row_step)))
    assert_array_equal(cloud.points, read_cloud(messages.encode(message)).points)
    assert "row_step" in cloud.corrected


@pytest.mark.parametrize("order", "<>")
def test_a_wrong_order_of_bytes_is_known_by_the_coordinates(order):
    layout = [(name, f"{order}f4") for name in ("x", "y", "z", "intensity")]
    message = messages.cloud(messages.xyzi(40, layout))
    cloud = read_cloud(messages.encode(dataclasses.replace(message, is_bigendian=order == "<")))
    assert_array_equal(cloud.points, read_cloud(messages.encode(message)).points)
    assert "is_bigendian" in cloud.corrected
    assert not read_cloud(messages.encode(message)).corrected


@pytest.mark.parametrize("turn_s", [0.1, -0.1, 0.05])
@pytest.mark.parametrize("seam", [0.0, 0.5 * np.pi, -0.7 * np.pi])
def test_a_turn_is_known_wherever_its_seam_is(seam, turn_s):
    cloud = turning(turn_s=turn_s, seam=seam)
    assert cloud.turn_s == pytest.approx(turn_s, rel=1e-2)
    assert np.cos(cloud.mid_rad - seam) == pytest.approx(-1.0, abs=1e-3)
    assert cloud.stamp_s == pytest.approx(1000.0 + abs(turn_s) / 2, abs=1e-3)


@pytest.mark.parametrize("wild", [1e9, -3.0, np.nan, np.inf])
def test_a_wild_time_of_a_point_costs_no_deskewing(wild):
    cloud = turning(kind="f8", unit=1.0, wild=wild)
    assert cloud.turn_s == pytest.approx(0.1, rel=1e-2)
    assert cloud.stamp_s == pytest.approx(1000.05, abs=1e-3)
