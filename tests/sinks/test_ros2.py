"""Results as topics of ROS 2, decoded by another implementation."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from modt.address import parse_address
from modt.errors import MisuseError
from modt.geometry import rotation_zyx, se3
from modt.ros2.static_transforms import StaticTransforms
from modt.schemes import SINKS
from modt.sinks import ros2_detections, ros2_markers, ros2_transform
from tests.results import CAR, PEDESTRIAN, result
from tests.ros2 import messages
from tests.ros2.network import FAR, NEAR, until

FRAMES = [
    result(0, [], {}),
    result(3, [5, 4, 7], {0: 1, 1: 12, 2: 1234567}, {1: CAR, 12: PEDESTRIAN}, lost=(99,)),
]
PLACED = se3(rotation_zyx(0.1, -0.2, 2.0), np.array([10.0, -20.0, 0.5]))


TOPICS = (
    ("/robot/detections", ros2_detections.TYPE),
    ("/robot/markers", ros2_markers.TYPE),
    ("/tf", ros2_transform.TYPE),
)


def detections(frame, background=False):
    return messages.decode(ros2_detections.encode(frame, "velodyne", background), "vision_msgs/msg/Detection3DArray")


def markers(frame):
    return messages.decode(ros2_markers.encode(frame, "velodyne"), "visualization_msgs/msg/MarkerArray").markers


def test_objects_alone_are_detections_unless_all_tracks_are_asked_for():
    said = {found.id: found.results[0].hypothesis.class_id for found in detections(FRAMES[1], True).detections}
    assert said == {"1": "car", "12": "pedestrian", "1234567": "background"}
    assert [found.id for found in detections(FRAMES[1]).detections] == ["1", "12"]


def test_every_track_that_is_seen_is_a_detection_with_its_id_and_posterior():
    message = detections(FRAMES[1], background=True)
    assert (message.header.frame_id, message.header.stamp.sec, message.header.stamp.nanosec) == (
        "velodyne",
        0,
        300_000_000,
    )
    assert [found.id for found in message.detections] == ["1", "12", "1234567"]
    car, pedestrian, _ = (
        [(r.hypothesis.class_id, r.hypothesis.score) for r in d.results] for d in message.detections
    )
    assert car == [("car", 0.7), ("background", 0.1), ("pedestrian", 0.1), ("cyclist", 0.1)]
    assert pedestrian[0] == ("pedestrian", 0.7)


def test_the_class_that_is_said_comes_first_though_another_is_more_probable():
    frame = result(1, [5], {0: 7}, {7: [0.6, 0.1, 0.3, 0.0]})
    frame.tracks.object_class[:] = 2
    (found,) = detections(frame).detections
    assert [r.hypothesis.class_id for r in found.results] == ["pedestrian", "background", "car", "cyclist"]


def test_a_detection_has_the_box_in_the_frame_of_the_sensor():
    frame = result(1, [5], {0: 7})
    frame.proposals.box[0] = [10.0, -2.0, -1.0, 4.0, 1.8, 1.5, 0.5]
    (found,) = detections(frame, background=True).detections
    at, turned, size = found.bbox.center.position, found.bbox.center.orientation, found.bbox.size
    assert (at.x, at.y, at.z, size.x, size.y, size.z) == (10.0, -2.0, -1.0, 4.0, 1.8, 1.5)
    np.testing.assert_allclose([turned.x, turned.y, turned.z, turned.w], [0, 0, np.sin(0.25), np.cos(0.25)])
    assert found.results[0].pose.pose == found.bbox.center
    assert (found.header.frame_id, found.header.stamp.nanosec) == ("velodyne", 100_000_000)


def test_a_frame_without_tracks_is_an_array_without_detections():
    assert detections(FRAMES[0]).detections == []


def test_objects_are_cubes_with_labels_and_those_before_are_deleted():
    deletion, *shown = markers(FRAMES[1])
    assert deletion.action == ros2_markers.DELETE_ALL
    assert [(m.ns, m.id, m.type) for m in shown] == [
        ("objects", 1, ros2_markers.CUBE), ("labels", 1, ros2_markers.TEXT),
        ("objects", 12, ros2_markers.CUBE), ("labels", 12, ros2_markers.TEXT),
    ]  # fmt: skip
    cube, label = shown[:2]
    assert (cube.scale.x, cube.scale.y, cube.scale.z, cube.lifetime.sec) == (4.0, 2.0, 1.5, 1)
    assert (cube.color.r, cube.color.g, cube.color.b) == pytest.approx((0x2F / 255, 0x6F / 255, 0xDE / 255))
    assert label.text == "car 1, 0.0 m/s"
    assert label.pose.position.z == pytest.approx(cube.pose.position.z + 0.75 + ros2_markers.ABOVE_M)
    assert [m.action for m in markers(FRAMES[0])] == [ros2_markers.DELETE_ALL]


def test_the_pose_of_the_sensor_is_a_transform_from_the_world():
    frame = result(3, [5], {0: 1}, T_world_sensor=PLACED)
    encoded = ros2_transform.encode(frame, "velodyne", "map")
    (found,) = messages.decode(encoded, "tf2_msgs/msg/TFMessage").transforms
    assert (found.header.frame_id, found.child_frame_id) == ("map", "velodyne")
    assert (found.header.stamp.sec, found.header.stamp.nanosec) == (0, 300_000_000)
    at = found.transform.translation
    assert (at.x, at.y, at.z) == (10.0, -20.0, 0.5)
    tree = StaticTransforms()
    tree.add(encoded)
    np.testing.assert_allclose(tree.between("map", "velodyne"), PLACED, atol=1e-12)


def test_a_frame_is_published_to_whom_has_subscribed(loopback):
    from modt.ros2 import dds
    from modt.sinks.ros2 import open_ros2

    sink = open_ros2(parse_address(f"ros2:///robot?domain={NEAR}&frame_id=velodyne&world_frame_id=map", SINKS))
    joined = dds.participant(FAR)
    seen = {kind: dds.Subscription(joined, topic, kind, depth=1, reliable=True) for topic, kind in TOPICS}
    until(lambda: all(publication.receivers for publication, _ in sink._topics))
    until(lambda: all(subscription.senders for subscription in seen.values()))
    sink.write(FRAMES[1])
    assert [m.data for m in seen[ros2_detections.TYPE].take(60.0)] == [ros2_detections.encode(FRAMES[1], "velodyne")]
    assert [m.data for m in seen[ros2_markers.TYPE].take(60.0)] == [ros2_markers.encode(FRAMES[1], "velodyne")]
    transform = ros2_transform.encode(FRAMES[1], "velodyne", "map")
    assert [m.data for m in seen[ros2_transform.TYPE].take(60.0)] == [transform]
    assert sink.health() == {"unsent": 0}
    sink.close()
    sink.write(FRAMES[0])


@pytest.mark.parametrize("option", ["", "&world_frame_id="])
def test_without_the_name_of_a_world_tf_is_left_alone(loopback, option):
    from modt.sinks.ros2 import open_ros2

    sink = open_ros2(parse_address(f"ros2:///robot?domain={NEAR}{option}", SINKS))
    assert len(sink._topics) == len(TOPICS) - 1
    sink.close()


@pytest.mark.parametrize(
    ("option", "received", "expected"),
    [
        ("", "os_sensor", "os_sensor"),
        ("", "", "lidar"),
        ("&frame_id=velodyne", "os_sensor", "velodyne"),
    ],
)
def test_results_are_in_the_frame_of_the_cloud_unless_the_address_names_another(loopback, option, received, expected):
    from modt.sinks.ros2 import open_ros2

    frame = dataclasses.replace(FRAMES[1], frame=dataclasses.replace(FRAMES[1].frame, frame_id=received))
    for tracks, background in (("", False), ("&tracks=objects", False), ("&tracks=all", True)):
        sink = open_ros2(parse_address(f"ros2:///robot?domain={NEAR}{option}{tracks}&world_frame_id=map", SINKS))
        assert [encode(frame) for _, encode in sink._topics] == [
            ros2_detections.encode(frame, expected, background),
            ros2_markers.encode(frame, expected),
            ros2_transform.encode(frame, expected, "map"),
        ]
        sink.close()


def test_tracks_of_an_unknown_kind_are_refused():
    pytest.importorskip("cyclonedds")
    from modt.sinks.ros2 import open_ros2

    with pytest.raises(MisuseError, match="tracks 'some' is unknown; write tracks=objects or tracks=all"):
        open_ros2(parse_address("ros2:///robot?tracks=some", SINKS))


def test_a_domain_that_is_none_is_refused():
    pytest.importorskip("cyclonedds")
    from modt.sinks.ros2 import open_ros2

    with pytest.raises(MisuseError, match="domain 'x' is none"):
        open_ros2(parse_address("ros2:///robot?domain=x", SINKS))
