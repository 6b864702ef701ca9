"""Given poses that turn wrong while driving: registration places the frames, until the poses are right again."""

from dataclasses import replace

import numpy as np
import pytest

from modt.app import assembly
from modt.geometry import FieldOfView, inverse, rotation_zyx, se3, transform_boxes
from modt.odometry.pose_check import PoseCheck
from modt.profile import load
from modt_simulation.synthetic_stream import SyntheticStream
from tests.odometry.odometry_scenes import static_tracks
from tests.odometry.odometry_scenes import street as street_of_boxes
from tests.tracking.tracking_scenes import Follower, frame_of

ONSET, END = 30, 50


def pose(x, y, yaw):
    return se3(rotation_zyx(0.0, 0.0, yaw), np.array([x, y, 0.0]))


def planar(T):
    return T[0, 3], T[1, 3], np.arctan2(T[1, 0], T[0, 0])


FAULTS = {
    "none": lambda now, onset: now,
    "frozen": lambda now, onset: onset,
    "half the scale": lambda now, onset: (
        onset[0] + (now[0] - onset[0]) / 2,
        onset[1] + (now[1] - onset[1]) / 2,
        now[2],
    ),
    "backwards": lambda now, onset: (2 * onset[0] - now[0], 2 * onset[1] - now[1], now[2]),
    "another frame": lambda now, onset: (-now[1], now[0], now[2]),
    "degrees": lambda now, onset: (now[0], now[1], np.rad2deg(now[2]) + 1.0),
}


@pytest.fixture(scope="module")
def street():
    return list(SyntheticStream("street", "vlp-16", 8.0, seed=3))


@pytest.mark.parametrize("name", FAULTS)
def test_wrong_poses_are_doubted_and_right_ones_believed_again(name, street):
    profile = load("vlp-16")
    mode = assembly.MODES["efficient"]
    continuity = assembly.Continuity()
    pipeline = assembly.pipeline(mode, profile, FieldOfView(), continuity=continuity)
    check = continuity.odometry.pose_check
    onset = planar(street[ONSET - 1].T_world_sensor)
    doubted = []
    off_m = []
    for k, frame in enumerate(street):
        given = frame
        if ONSET <= k < END:
            given = replace(frame, T_world_sensor=pose(*FAULTS[name](planar(frame.T_world_sensor), onset)))
        result = pipeline.step(given, mode.budget(profile))
        doubted.append(check.doubted)
        if given is frame:
            off_m.append(np.hypot(*(result.T_world_sensor - frame.T_world_sensor)[:2, 3]))
    assert not any(doubted[:ONSET])
    assert any(doubted[ONSET : ONSET + 5]) == (name != "none")
    assert not doubted[-1]
    assert max(off_m) < 0.5


STEP_M = 0.07


@pytest.mark.parametrize("share", [0.0, 0.5, -1.0, 2.0])
def test_poses_wrong_by_centimetres_a_frame_are_doubted_and_what_rests_stays_at_rest(share):
    follower = Follower()
    boxes = street_of_boxes(n=40)
    for k in range(80):
        x = STEP_M * k
        given_x = x if k < ONSET else STEP_M * ONSET + share * (x - STEP_M * ONSET)
        seen = transform_boxes(inverse(pose(x, 0.0, 0.0)), boxes)
        follower.follow(*frame_of(seen, k, pose(given_x, 0.0, 0.0), points=150))
    assert follower.odometry.pose_check.doubted
    assert np.percentile(follower.tracks.x[:, 3], 95) < 0.2


def test_poses_wrong_since_before_anything_was_seen_are_doubted():
    follower = Follower()
    boxes = street_of_boxes(n=40)
    for k in range(20):
        seen = transform_boxes(inverse(pose(0.6 * k, 0.0, 0.0)), boxes)
        follower.follow(*frame_of(seen, k, pose(0.0, 0.0, 0.0), points=150))
    assert follower.odometry.pose_check.doubted


DIRECTION_RAD = np.pi / 4 * np.arange(8)
ALONG, ACROSS = np.cos(DIRECTION_RAD), np.sin(DIRECTION_RAD)
"""Shift that a metre along x and along y adds to each side of a k-DOP [m]."""
SQUARE = [1.0, 1.0, 1.0, 1.0, 0.0, 0.0, 0.0, 0.0]


def check_of(kdop):
    """A check that has seen tracks at rest from the origin."""
    check = PoseCheck()
    assert not check.check_drift(0.0, static_tracks(kdop), pose(0.0, 0.0, 0.0))
    return check


@pytest.mark.parametrize(("step_m", "way_m", "drifted"), [(0.1, 0.0, False), (0.3, 0.0, True), (0.3, 10.0, False)])
def test_what_rested_may_move_by_the_errors_of_a_way(step_m, way_m, drifted):
    kdop = np.tile(SQUARE, (8, 1))
    step = step_m * ALONG
    check = check_of(kdop)
    assert not check.check_drift(0.5, static_tracks(kdop + 5 * step), pose(way_m, 0.0, 0.0))  # not looked at so soon
    assert check.check_drift(1.0, static_tracks(kdop + step), pose(way_m, 0.0, 0.0)) == drifted


@pytest.mark.parametrize(
    ("turn_rad", "wrong_rad", "drifted"), [(1.0, 0.015, False), (0.0, 0.015, True), (1.0, 0.1, True)]
)
def test_what_rested_may_move_by_an_error_of_the_scale_of_a_turn(turn_rad, wrong_rad, drifted):
    """Most of what is seen is at 20 m on one side, so that a turn moves it alike."""
    kdop = np.tile([21.0, 15.0, 1.0, -13.0, -19.0, -13.0, 1.0, 15.0], (8, 1))
    step = 20.0 * wrong_rad * ACROSS
    assert check_of(kdop).check_drift(1.0, static_tracks(kdop + step), pose(0.0, 0.0, turn_rad)) == drifted


def around(angle_rad, range_m=10.0):
    """(n, 8) k-DOPs of squares around the origin at some bearings (n,)."""
    x, y = range_m * np.cos(angle_rad), range_m * np.sin(angle_rad)
    return SQUARE + x[:, None] * ALONG + y[:, None] * ACROSS


@pytest.mark.parametrize(
    ("steps_m", "drifted"),
    [
        ([0.0, 0.0, 0.0, 0.3, 0.3, 0.3], False),
        ([0.1, 0.9, -0.4, 0.5, -0.2, 0.7], False),
        ([0.3, 0.3, 0.3, 0.3, 0.3, 0.0], True),
    ],
    ids=["half of them begin to walk", "each by another way", "all but one"],
)
def test_what_rested_has_to_move_as_one_body(steps_m, drifted):
    kdop = around(np.linspace(0, 5, 6))
    moved = kdop + np.array(steps_m)[:, None] * ACROSS
    assert check_of(kdop).check_drift(1.0, static_tracks(moved), pose(0.0, 0.0, 0.0)) == drifted


def test_what_rested_all_around_turns_as_one_body():
    bearing = np.linspace(0, 6, 12)
    kdop = around(bearing)
    assert check_of(kdop).check_drift(1.0, static_tracks(around(bearing + 0.04)), pose(0.0, 0.0, 0.0))


@pytest.mark.parametrize(
    ("n_resting", "wrong_m", "drifted"),
    [(8, 0.0, False), (8, 0.25, True), (2, 0.0, True)],
    ids=["right pose", "pose of twice the way", "nearly all move with the sensor"],
)
def test_parts_of_walls_that_move_with_the_sensor_say_nothing_of_its_pose(n_resting, wrong_m, drifted):
    """A pose that moves by half a metre, and 12 parts of a wall that follow the sensor."""
    kdop = np.tile(SQUARE, (n_resting + 12, 1))
    moved_m = np.repeat([wrong_m, 0.5], [n_resting, 12])
    assert (
        check_of(kdop).check_drift(1.0, static_tracks(kdop + moved_m[:, None] * ALONG), pose(0.5, 0.0, 0.0))
        == drifted
    )


@pytest.mark.parametrize(
    ("off_m", "turned_rad", "convinced"), [(0.05, 0.004, False), (0.3, 0.0, True), (0.0, 0.1, True)]
)
def test_few_landmarks_in_place_refute_no_pose_that_registration_confirms(off_m, turned_rad, convinced):
    given = pose(3.0, 1.0, 0.5)
    registered = given @ pose(off_m, 0.0, turned_rad)
    assert PoseCheck().convinces(given, registered, n_known=21, n_near=3, n_near_registered=7) == convinced
