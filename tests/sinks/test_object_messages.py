"""Published objects as messages that stacks read, decoded by another implementation."""

import dataclasses

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation

from modt.geometry import rotation_zyx, se3, transform
from modt.placement import Mount
from modt.sinks import object_messages
from modt.sinks.topics import TopicOptions, topics
from modt.types import MotionState
from tests.results import CAR, PEDESTRIAN, result
from tests.ros2 import messages

TURNED = se3(rotation_zyx(0.0, 0.0, np.pi / 2), np.array([10.0, -20.0, 0.5]))
"""The sensor looks along y of the world."""


@pytest.fixture
def frame():
    """A car that goes along y, a pedestrian who stands, something unknown that goes along -x, and background."""
    made = result(3, [5, 5, 5, 5], {0: 1, 1: 2, 2: 300, 3: 4}, {1: CAR, 2: PEDESTRIAN}, T_world_sensor=TURNED)
    tracks = made.tracks
    tracks.motion[:] = [MotionState.MOVING, MotionState.STILL, MotionState.MOVING, MotionState.UNKNOWN]
    tracks.moving_probability[:] = [1.0, 0.0, 0.9, 0.5]
    tracks.posterior[2:] = [0.97, 0.01, 0.01, 0.01]
    tracks.velocity[0] = [0.0, 5.0]
    tracks.velocity[2] = [-2.0, 0.0]
    tracks.velocity_covariance[0] = np.diag([0.04, 0.25])
    tracks.P[0, :2, :2] = np.diag([0.01, 0.09])
    tracks.whole_box[0] = [10.0, -10.0, 1.2, 4.4, 1.8, 1.5, np.pi / 2]
    tracks.heading_known[0] = True
    return made


def decoded(frame, form, **options):
    """The message of the objects."""
    topic = topics(TopicOptions(messages=form, **options))[0]
    return messages.decode(topic.encode(frame), topic.type.replace("/", "/msg/"))


def test_what_moves_is_a_detection_whatever_its_class(frame):
    found = decoded(frame, "vision").detections
    first = {found.id: (found.results[0].hypothesis.class_id, found.results[0].hypothesis.score) for found in found}
    assert {track: name for track, (name, _) in first.items()} == {"1": "car", "2": "pedestrian", "300": "other"}
    assert first["300"][1] == pytest.approx(0.9)
    covariance = found[0].results[0].pose.covariance.reshape(6, 6)
    assert_allclose(np.diag(covariance)[:3], [0.09, 0.01, 0.0], atol=1e-12)


def test_tracked_objects_of_autoware_move_along_their_boxes(frame):
    message = decoded(frame, "autoware")
    assert message.header.frame_id == "lidar"
    car, person, other = message.objects
    assert [int.from_bytes(bytes(found.object_id.uuid), "big") for found in message.objects] == [1, 2, 300]
    assert other.existence_probability == pytest.approx(0.9)
    labels = {c.label: c.probability for c in car.classification}
    assert labels == pytest.approx(
        {
            object_messages.UNKNOWN: CAR[0],
            1: CAR[1],
            7: CAR[2],
            6: CAR[3],
        }
    )
    at = car.kinematics.pose_with_covariance.pose.position
    assert_allclose([at.x, at.y, at.z], [10.0, 0.0, 0.7], atol=1e-12)
    speed = car.kinematics.twist_with_covariance.twist.linear
    assert_allclose([speed.x, speed.y, speed.z], [5.0, 0.0, 0.0], atol=1e-12)
    assert_allclose(
        np.diag(car.kinematics.twist_with_covariance.covariance.reshape(6, 6))[:2], [0.25, 0.04], atol=1e-12
    )
    known = object_messages.AVAILABLE, object_messages.SIGN_UNKNOWN
    assert (car.kinematics.orientation_availability, other.kinematics.orientation_availability) == known
    assert [found.kinematics.is_stationary for found in message.objects] == [False, True, False]
    size = car.shape.dimensions
    assert (car.shape.type, size.x, size.y, size.z) == (object_messages.BOUNDING_BOX, 4.4, 1.8, 1.5)
    assert len(person.shape.footprint.points) == 0


def test_obstacles_of_nav2_have_velocities_in_the_frame_of_the_message(frame):
    car, _, other = decoded(frame, "nav2").obstacles
    assert_allclose([car.position.x, car.position.y], [10.0, 0.0], atol=1e-12)
    assert_allclose([car.velocity.x, car.velocity.y], [5.0, 0.0], atol=1e-12)
    assert_allclose([other.velocity.x, other.velocity.y], [0.0, 2.0], atol=1e-12)
    assert_allclose([car.size.x, car.size.y, car.size.z], [4.4, 1.8, 1.5], atol=1e-12)
    assert other.score == pytest.approx(0.9)


@pytest.mark.parametrize("form", ["vision", "autoware", "nav2"])
def test_the_background_comes_where_it_is_asked_for_and_nothing_where_nothing_is(frame, form):
    count = {"vision": "detections", "autoware": "objects", "nav2": "obstacles"}[form]
    assert len(getattr(decoded(frame, form), count)) == 3
    assert len(getattr(decoded(frame, form, background=True), count)) == 4
    assert len(getattr(decoded(result(0, [], {}), form), count)) == 0


def test_velocities_of_a_tilted_sensor_are_along_its_own_axes(frame):
    mount = Mount.of(10.0, -5.0)
    T_level_sensor = se3(mount.level(frame.frame).R_level_sensor, np.zeros(3))
    T_world_sensor = TURNED @ T_level_sensor
    level = mount.level(dataclasses.replace(frame.frame, T_world_sensor=T_world_sensor))
    shown = dataclasses.replace(frame, frame=level, T_world_sensor=level.T_world_sensor)
    car = decoded(shown, "nav2").obstacles[0]
    velocity = np.array([car.velocity.x, car.velocity.y, car.velocity.z])
    assert_allclose(T_world_sensor[:3, :3] @ velocity, [0.0, 5.0, 0.0], atol=1e-9)
    place = np.array([[car.position.x, car.position.y, car.position.z]])
    assert_allclose(transform(T_world_sensor, place), [frame.tracks.whole_box[0, :3]], atol=1e-9)
    pose = decoded(shown, "autoware").objects[0].kinematics.pose_with_covariance.pose.orientation
    ahead = Rotation.from_quat([pose.x, pose.y, pose.z, pose.w]).apply([1.0, 0.0, 0.0])
    assert_allclose(T_world_sensor[:3, :3] @ ahead, [0.0, 1.0, 0.0], atol=1e-9)


def test_tracks_of_another_run_have_another_identity(frame):
    run_ids = ("00ff" * 4, "ab" * 8)
    found = [decoded(dataclasses.replace(frame, run_id=run), "nav2").obstacles[0].uuid.uuid for run in run_ids]
    assert [bytes(identity) for identity in found] == [bytes.fromhex(run) + bytes([0] * 7 + [1]) for run in run_ids]


def test_what_may_be_a_person_too_near_to_be_seen_whole_is_published(frame):
    frame.proposals.cut[3] = 1
    frame.proposals.box[3, 3:6] = [0.4, 0.3, 0.4]
    ids = {found.id: found.results[0].hypothesis.class_id for found in decoded(frame, "vision").detections}
    assert ids["4"] == "unknown_near"
