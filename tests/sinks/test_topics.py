"""Results as messages of ROS 2, decoded by another implementation."""

import dataclasses

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from modt.geometry import rotation_zyx, se3, transform
from modt.placement import Mount
from modt.ros2.odometry import Transforms, read_odometry
from modt.ros2.point_cloud2 import read_cloud
from modt.schemes import SINKS
from modt.sinks import markers
from modt.sinks.topics import TopicOptions, topics
from modt.types import OBSTACLES, MotionState, PointKind
from tests.results import CAR, PEDESTRIAN, result, with_kinds
from tests.ros2 import messages

PLACED = se3(rotation_zyx(0.1, -0.2, 2.0), np.array([10.0, -20.0, 0.5]))
EMPTY = result(0, [], {})
FRAME = result(3, [5, 4, 7], {0: 1, 1: 12, 2: 1234567}, {1: CAR, 12: PEDESTRIAN}, lost=(99,), T_world_sensor=PLACED)
LABELLED = with_kinds(FRAME)


def published(frame, **options):
    """The decoded message of each topic."""
    return {
        topic.name: messages.decode(topic.encode(frame), topic.type.replace("/", "/msg/"))
        for topic in topics(TopicOptions(**options))
    }


def detections(frame, **options):
    return published(frame, **options)["/modt/detections"].detections


def test_topics_are_named_by_the_prefix_and_tf_and_points_are_asked_for():
    always = {"/robot/detections", "/robot/markers", "/robot/odometry", "/robot/diagnostics"}
    assert {topic.name for topic in topics(TopicOptions(prefix="robot"))} == always
    more = topics(TopicOptions(prefix="robot", world_frame_id="map", points=True, obstacles=True))
    assert {topic.name for topic in more} == {*always, "/tf", "/robot/points", "/robot/obstacles", "/robot/ground"}


@pytest.mark.parametrize(
    ("option", "received", "expected"),
    [("", "os_sensor", "os_sensor"), ("", "", "lidar"), ("velodyne", "os_sensor", "velodyne")],
)
def test_results_are_in_the_frame_of_the_input_unless_another_is_named(option, received, expected):
    frame = dataclasses.replace(LABELLED, frame=dataclasses.replace(FRAME.frame, frame_id=received))
    shown = published(frame, frame_id=option, world_frame_id="map", points=True, obstacles=True)
    odometry = shown["/modt/odometry"]
    (tf,) = shown["/tf"].transforms
    clouds = [shown[f"/modt/{name}"] for name in ("points", "obstacles", "ground")]
    stamped = [shown["/modt/detections"], *clouds, *shown["/modt/markers"].markers]
    assert {message.header.frame_id for message in stamped} == {expected}
    assert {odometry.child_frame_id, tf.child_frame_id} == {expected}
    assert {odometry.header.frame_id, tf.header.frame_id} == {"map"}
    for message in (*stamped, odometry, tf):
        assert (message.header.stamp.sec, message.header.stamp.nanosec) == (0, 300_000_000)


def test_a_detection_has_its_box_and_the_reported_class_first_though_another_is_more_probable():
    frame = result(1, [5], {0: 7}, {7: [0.6, 0.1, 0.3, 0.0]})
    frame.tracks.object_class[:] = 2
    frame.tracks.whole_box[0] = [10.0, -2.0, -1.0, 4.0, 1.8, 1.5, 0.5]  # in the world, where the sensor is
    (found,) = detections(frame)
    hypotheses = [(r.hypothesis.class_id, r.hypothesis.score) for r in found.results]
    assert hypotheses == [("pedestrian", 0.3), ("background", 0.6), ("car", 0.1), ("cyclist", 0.0)]
    at = found.bbox.center.position
    turned = found.bbox.center.orientation
    size = found.bbox.size
    assert (at.x, at.y, at.z, size.x, size.y, size.z) == (10.0, -2.0, -1.0, 4.0, 1.8, 1.5)
    assert_allclose([turned.x, turned.y, turned.z, turned.w], [0, 0, np.sin(0.25), np.cos(0.25)])
    assert found.results[0].pose.pose == found.bbox.center


def test_objects_are_cubes_with_labels_and_an_arrow_along_their_motion():
    frame = result(3, [5, 4, 7], {0: 1, 1: 12, 2: 13}, {1: CAR, 12: PEDESTRIAN, 13: PEDESTRIAN})
    frame.tracks.velocity[:, 0] = [2.0, 0.0, -1.5]
    frame.tracks.motion[[0, 2]] = MotionState.MOVING
    deletion, *rest = published(frame)["/modt/markers"].markers
    assert deletion.action == markers.DELETE_ALL
    shown = {(marker.ns, marker.id): marker for marker in rest}
    everybody = {(name, track) for name in ("objects", "labels") for track in (1, 12, 13)}
    assert shown.keys() == {*everybody, ("motion", 1), ("motion", 13)}
    cube = shown["objects", 1]
    label = shown["labels", 1]
    assert (cube.type, cube.scale.x, cube.scale.y, cube.scale.z) == (markers.CUBE, 4.0, 2.0, 1.5)
    assert label.text == "car 1, 2.0 m/s"
    assert label.pose.position.z > cube.pose.position.z + cube.scale.z / 2
    assert (shown["motion", 1].scale.x, shown["motion", 1].pose.orientation.w) == pytest.approx((2.0, 1.0))
    assert (shown["motion", 13].scale.x, abs(shown["motion", 13].pose.orientation.z)) == pytest.approx((1.5, 1.0))


@pytest.mark.parametrize("form", ["vision", "autoware", "nav2"])
def test_numbers_beyond_31_bits_break_no_message(form):
    ids = (2**31, 2**40 + 7)
    far = result(3, [5, 4], dict(enumerate(ids)), dict.fromkeys(ids, CAR))
    far = with_kinds(dataclasses.replace(far, frame=dataclasses.replace(far.frame, stamp_s=2.0**33)))
    shown = published(far, messages=form, obstacles="all")
    numbers = [marker.id for marker in shown["/modt/markers"].markers if marker.ns == "objects"]
    assert numbers == [0, 7]
    assert all(marker.header.stamp.sec == 2**31 - 1 for marker in shown["/modt/markers"].markers if marker.ns)


def test_the_pose_of_the_sensor_is_an_odometry_and_a_transform():
    encoded = {topic.name: topic.encode(FRAME) for topic in topics(TopicOptions(world_frame_id="map"))}
    tree = Transforms()
    tree.add(encoded["/tf"])
    for T in (tree.between("map", "lidar"), read_odometry(encoded["/modt/odometry"]).T_odom_child):
        assert_allclose(T, PLACED, atol=1e-12)


def test_points_of_a_tilted_sensor_are_as_it_sent_them_and_in_their_place_in_the_world():
    level = dataclasses.replace(LABELLED.frame, T_world_sensor=PLACED)
    tilted = Mount.of(10.0, -5.0).level(level)
    frame = dataclasses.replace(LABELLED, frame=tilted, T_world_sensor=tilted.T_world_sensor)
    encoded = {topic.name: topic.encode(frame) for topic in topics(TopicOptions(points=True, obstacles=True))}
    points = read_cloud(encoded["/modt/points"]).points
    assert_allclose(points[:, :3], level.points[:, :3], atol=1e-4)
    standing = read_cloud(encoded["/modt/obstacles"]).points
    assert_allclose(standing[:, :3], level.points[frame.obstacles(), :3], atol=1e-4)
    T = read_odometry(encoded["/modt/odometry"]).T_odom_child
    inside = points[:, :3].astype(np.float64)
    placed = tilted.points[:, :3].astype(np.float64)
    assert_allclose(transform(T, inside), transform(tilted.T_world_sensor, placed), atol=1e-3)


def rows_of(message):
    """Points of a PointCloud2, by the fields that the message states."""
    formats = {2: "u1", 5: "<i4", 7: "<f4"}  # by sensor_msgs/PointField
    layout = np.dtype(
        {
            "names": [field.name for field in message.fields],
            "formats": [formats[field.datatype] for field in message.fields],
            "offsets": [field.offset for field in message.fields],
            "itemsize": message.point_step,
        }
    )
    assert message.row_step == message.width * message.point_step == len(message.data)
    assert (message.height, message.is_bigendian, message.is_dense) == (1, False, True)
    return np.frombuffer(message.data.tobytes(), layout)


def test_obstacles_and_ground_are_points_with_the_track_or_the_kind_and_the_class():
    shown = published(LABELLED, obstacles=True)
    found = rows_of(shown["/modt/obstacles"])
    ground = rows_of(shown["/modt/ground"])
    labels = LABELLED.labels
    assert found.dtype.names == ("x", "y", "z", "track", "class")
    for points, rows in ((found, LABELLED.obstacles()), (ground, np.flatnonzero(labels == PointKind.GROUND))):
        xyz = np.column_stack([points[axis] for axis in "xyz"])
        assert_array_equal(xyz, LABELLED.frame.points[rows, :3])
        assert points["track"].tolist() == labels[rows].tolist()
    classes = dict(zip(found["track"].tolist(), found["class"].tolist(), strict=True))
    assert classes == {1: 1, 12: 2, 1234567: 0, **dict.fromkeys(OBSTACLES, 0)}
    assert set(ground["class"].tolist()) == {0}
    assert len(found) + len(ground) < len(labels), "points out of range and overhead are neither"


def test_a_frame_without_points_has_clouds_without_points():
    shown = published(with_kinds(result(0, [], {}, n_points=0)), obstacles=True, points=True)
    assert [len(rows_of(shown[f"/modt/{name}"])) for name in ("points", "obstacles", "ground")] == [0, 0, 0]


@pytest.mark.parametrize("scheme", ["ros2", "mcap", "foxglove"])
def test_obstacles_are_an_option_of_each_sink_of_topics(scheme):
    assert "obstacles" in SINKS[scheme].options
