"""Ego-motion by registration against stationary objects."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

from modt.geometry import inverse, rotation_zyx, se3, transform_boxes, yaw_of
from modt.observations import observe
from modt.odometry.registration import LandmarkMap, Landmarks, Registration
from modt.odometry.tuning import LandmarkTuning, RegistrationTuning
from tests.odometry.odometry_scenes import static_tracks, street
from tests.tracking.tracking_scenes import EYE, Follower, frame_of

N_OBJECTS = 40
ESTABLISHED_FRAMES = LandmarkTuning().established_frames
REACH_M = RegistrationTuning().reach_m


def gentle_curve(i):
    yaw = 0.008 * i
    return se3(rotation_zyx(0, 0, yaw), np.array([0.8 * i, 0.003 * i * i, 0.0]))


def drive(frames, pose=gentle_curve, given=lambda i: (None, 0), world=None, points=150):
    """Odometry and tracker after a drive past a world of boxes, given poses and restarts of each frame."""
    follower = Follower()
    world = street(n=N_OBJECTS) if world is None else world
    for i in range(frames):
        boxes = transform_boxes(inverse(pose(i)), world(i) if callable(world) else world)
        T_given, restarts = given(i)
        frame, proposals = frame_of(boxes, i, T_given, points=points)
        follower.follow(replace(frame, restarts=restarts), proposals)
    return follower


def pose_error(T, follower):
    """Distance [m] and turn [degrees] between a pose and the estimated one."""
    error = inverse(T) @ follower.T_world_sensor
    return np.hypot(*error[:2, 3]), abs(np.rad2deg(yaw_of(error)))


@pytest.mark.parametrize(("moving", "frames", "most", "most_deg"), [(0, 30, 0.02, 0.3), (13, 20, 0.03, 0.5)])
def test_the_path_is_found_among_stationary_objects_though_others_move(moving, frames, most, most_deg):
    def world(i):
        boxes = street(n=N_OBJECTS)
        boxes[:moving, 0] += 1.2 * i
        return boxes

    follower = drive(frames, world=world)
    distance, turn = pose_error(gentle_curve(frames - 1), follower)
    assert distance < most * 0.8 * (frames - 1)
    assert turn < most_deg
    R = follower.T_world_sensor[:3, :3]
    assert_allclose(R @ R.T, np.eye(3), atol=1e-12)


T_OTHER = se3(rotation_zyx(0, 0, 2.0), np.array([400.0, -90.0, 0.0]))
GIVEN = {  # pose of a frame as the odometry gives it, and its restarts
    "first far from the origin": lambda i: (T_OTHER @ gentle_curve(0) if i == 0 else None, 0),
    "missing": lambda i: (None if 8 <= i < 14 else gentle_curve(i), 0),
    "begins late": lambda i: (None if i < 6 or i in (12, 13) else T_OTHER @ gentle_curve(i), 0),
    "restarts": lambda i: (
        (gentle_curve(i), 0) if i < 8 else (None if i < 10 else inverse(gentle_curve(10)) @ gentle_curve(i), 1)
    ),
}


@pytest.mark.parametrize("given", GIVEN)
def test_no_track_is_moved_where_poses_are_missing_begin_late_or_restart(given):
    follower = drive(20, given=GIVEN[given])
    assert len(follower.tracks) == N_OBJECTS
    assert follower.tracks.age.min() == 20
    T_world_start = T_OTHER if given.startswith("first") else EYE
    assert_allclose(follower.T_world_sensor, T_world_start @ gentle_curve(19), atol=0.15)


def test_a_roll_or_a_climb_does_not_go_on_where_poses_end():
    def rolling(i):
        return gentle_curve(i) @ se3(rotation_zyx(0.01 * i, 0.0, 0.0), np.array([0.0, 0.0, 0.05 * i]))

    follower = drive(30, given=lambda i: (rolling(i) if i < 8 else None, 0))
    assert follower.T_world_sensor[2, 3] == pytest.approx(rolling(7)[2, 3])
    assert follower.T_world_sensor[2, 2] == pytest.approx(1.0)
    distance, turn = pose_error(gentle_curve(29), follower)
    assert turn < 0.5
    assert distance < 0.3


def test_a_world_stays_upright_where_poses_begin_again():
    def rolling(i):
        return gentle_curve(i) @ se3(rotation_zyx(0.01 * i, 0.0, 0.0), np.zeros(3))

    follower = drive(20, given=lambda i: (None if 6 <= i < 14 else rolling(i), i >= 14))
    assert_allclose(follower.T_world_sensor[2, :3], rolling(19)[2, :3], atol=1e-9)


def test_without_landmarks_the_last_motion_continues():
    follower = drive(10)
    before = follower.T_world_sensor.copy()
    follower.follow(*frame_of([], 10, None))
    step = inverse(before) @ follower.T_world_sensor
    assert_allclose(step, inverse(gentle_curve(8)) @ gentle_curve(9), atol=0.05)


@pytest.mark.parametrize(
    ("turns_rad", "step_m", "objects", "most_m", "most_deg"),
    [
        ([0.0] * 9 + [0.08] * 10 + [0.0] * 10, 0.8, {"n": N_OBJECTS}, 0.3, 0.6),  # at first the prediction is off
        ([0.0] * 9 + [0.1] * 4, 0.8, {"n": 150, "seed": 1}, 0.05, 0.1),
        ([0.15] * 3, 0.0, {"n": 150}, 0.3, 1.0),  # while no motion is known, several turns are tried
        ([-0.15] * 3, 0.0, {"n": 150}, 0.3, 1.0),
    ],
    ids=["passing", "sharp", "initial", "initial to the right"],
)
def test_sudden_turns_are_followed(turns_rad, step_m, objects, most_m, most_deg):
    poses = [EYE]
    for turn_rad in turns_rad:
        R = rotation_zyx(0, 0, turn_rad)
        poses.append(poses[-1] @ se3(R, R @ [step_m, 0, 0]))
    follower = drive(len(poses), pose=poses.__getitem__, world=street(**objects), points=9000 // objects["n"])
    distance, turn = pose_error(poses[-1], follower)
    assert turn < most_deg
    assert distance < most_m


def test_the_error_of_one_frame_is_not_carried_on():
    """Landmarks are mean positions, so that one wrong pose does not move the world."""
    rng = np.random.default_rng(5)
    jitter = np.zeros((80, N_OBJECTS, 7))
    jitter[..., :2] = rng.normal(0, 0.05, (80, N_OBJECTS, 2))
    follower = drive(80, pose=lambda i: EYE, world=lambda i: street(n=N_OBJECTS) + jitter[i])
    assert abs(np.rad2deg(yaw_of(follower.T_world_sensor))) < 0.05
    assert np.hypot(*follower.T_world_sensor[:2, 3]) < 0.02


def test_landmarks_restart_where_poses_end_again():
    """A drift of the given poses does not snap back when they end."""

    def drifted(i):
        return se3(np.eye(3), np.array([0.15 * (i - 6) / 199, 0.0, 0.0])) if 6 <= i < 206 else None

    follower = Follower()
    world = street(n=N_OBJECTS)
    for i in range(211):
        follower.follow(*frame_of(world, i, drifted(i), points=150))
        if i == 205:
            before = follower.T_world_sensor[0, 3]
        if i > 205:
            assert abs(follower.T_world_sensor[0, 3] - before) < 0.01
    assert before == pytest.approx(0.15, abs=0.02)


def observed(boxes, T=EYE):
    """Observations of boxes of the world, placed by T. The points do not depend on T."""
    return observe(frame_of(boxes, 0, points=150)[1], T)


def landmarks_of(boxes):
    """Established landmarks at boxes."""
    return Landmarks(observed(boxes).kdop, np.ones(len(boxes), np.bool_))


@settings(max_examples=20)
@given(
    x=st.floats(-0.5, 0.5),
    y=st.floats(-0.5, 0.5),
    turn=st.floats(-0.02, 0.02),
    seed=st.integers(0, 2**16),
    grown_m=st.sampled_from([0.0, 0.3]),
)
def test_observations_are_brought_onto_their_landmarks_though_ends_came_into_view(x, y, turn, seed, grown_m):
    """One end of every axis shows the motion. The other end came into view at random."""
    rng = np.random.default_rng(seed)
    world = street(seed, 60)
    T = se3(rotation_zyx(0, 0, turn), np.array([x, y, 0.0]))
    grown = observed(world, T)
    ahead = rng.random((4, 60)) < 0.5
    kdop = grown.kdop + np.concatenate([ahead, ~ahead]) * grown_m * rng.exponential(1.0, (8, 60))
    correction = Registration().correct(landmarks_of(world), replace(grown, kdop=kdop))
    assert_allclose(correction @ T, EYE, atol=0.01 + grown_m / 6)


def moved(*xy):
    """(4, 4) shift in the plane."""
    return se3(np.eye(3), np.array([*xy, 0.0]))


@pytest.mark.parametrize("n", [0, 1, 2])
def test_too_few_landmarks_give_no_correction(n):
    world = street(n=30)
    correction = Registration().correct(landmarks_of(world[:n]), observed(world, moved(0.3, 0.0)))
    assert_array_equal(correction, EYE)


def test_a_correction_beyond_the_reach_is_refused():
    world = street(n=60)
    reach_m = REACH_M / np.sqrt(2)  # along each axis
    refused = moved(1.2 * reach_m, 1.2 * reach_m)
    accepted = moved(0.8 * reach_m, 0.8 * reach_m)
    assert_array_equal(Registration().correct(landmarks_of(world), observed(world, refused)), EYE)
    correction = Registration().correct(landmarks_of(world), observed(world, accepted))
    assert_allclose(correction @ accepted, EYE, atol=0.02)


def test_the_mean_of_an_end_restarts_where_another_one_comes_into_view():
    landmark_map = LandmarkMap()
    kdop = np.arange(16.0).reshape(2, 8)
    for shift_m in (0.0, 0.1, 0.2):
        landmark_map.update(static_tracks(kdop + shift_m, observed=[True, False]))
    kdop[0, 2] += 0.5
    landmarks = landmark_map.update(static_tracks(kdop, observed=[True, False]))
    assert landmarks.established.tolist() == [True, False]
    mean = kdop[0] + 0.075  # of four views
    mean[2] = kdop[0, 2]
    assert_allclose(landmarks.kdop.T, [mean, kdop[1]])  # the one that was never observed is predicted


def test_landmarks_are_candidates_at_rest_by_their_ids():
    landmark_map = LandmarkMap()
    kdop = np.arange(32.0).reshape(4, 8)
    for _ in range(ESTABLISHED_FRAMES):
        landmarks = landmark_map.update(static_tracks(kdop, ids=[2, 5, 7, 8], candidate=[True, True, True, False]))
    assert landmarks.established.tolist() == [True, True, True]
    kdop = np.stack([kdop[1], kdop[2] + 0.4, np.full(8, 50.0)])
    at_rest = static_tracks(kdop, ids=[5, 7, 9])
    landmarks = landmark_map.update(replace(at_rest, stationary=np.array([True, False, True])))
    assert landmarks.established.tolist() == [True, False, False]
    assert_allclose(landmarks.kdop.T, kdop)
    for frames in range(1, ESTABLISHED_FRAMES + 1):  # at rest again: the mean restarts
        assert landmark_map.update(at_rest).established[1] == (frames >= ESTABLISHED_FRAMES)
    landmark_map.clear()
    assert not landmark_map.update(at_rest).established.any()
