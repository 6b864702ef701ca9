"""Deskew of the sweeps of a turning head on a moving carrier to one time."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from modt.geometry import inverse, rotation_zyx, se3, transform, yaw_of
from modt.geometry.kdop import centres
from modt.placement import Placement, PlanarMotion, delays
from modt.types import Proposals
from tests.odometry.odometry_scenes import constant_turn, constant_turn_pose, street
from tests.tracking.tracking_scenes import Follower, frame_of

PERIOD_S = 0.1


def skewed_points(xyz, time_s, turn_s, speed, turn, mid_rad=0.0):
    """(n, 3) points of the world in the sensor's frame at the time of view, and (n,) that time after the stamp [s].

    The time follows from the bearing, which depends on the time: fixed-point iteration.
    """
    place = xyz[:, 0] + 1j * xyz[:, 1]
    late = np.zeros(len(xyz))
    for _ in range(30):
        c, yaw = constant_turn(time_s + late, speed, turn)
        local = (place - c) * np.exp(-1j * yaw)
        late = -turn_s * np.angle(local * np.exp(-1j * mid_rad)) / (2 * np.pi)
    return np.c_[local.real, local.imag, xyz[:, 2]], late


def skewed(boxes, index, turn_s, speed, turn, posed, mid_rad=0.0):
    """A frame of boxes of the world (P, 7) as a turning head on a moving carrier sees them."""
    frame, proposals = frame_of(boxes, index, points=80)
    true_xyz = frame.points[:, :3].astype(np.float64)
    xyz, _ = skewed_points(true_xyz, index * PERIOD_S, turn_s, speed, turn, mid_rad)
    groups = np.split(xyz, proposals.offsets[1:-1])
    centroid = np.array([g.mean(axis=0) for g in groups])
    local = boxes.copy()
    local[:, :3] = centroid
    local[:, 6] -= turn * index * PERIOD_S
    T = constant_turn_pose(index * PERIOD_S, speed, turn) if posed else None
    points = np.c_[xyz, frame.points[:, 3]].astype(np.float32)
    frame = replace(frame, points=points, T_world_sensor=T, turn_s=turn_s, mid_rad=mid_rad)
    return frame, replace(proposals, coordinates=xyz.T.astype(np.float32), centroid=centroid, box=local)


@given(st.floats(-20, 20), st.floats(-2.5, 2.5), st.sampled_from([0.1, -0.1, 0.05]), st.integers(0, 2**16))
def test_deskewed_points_lie_at_their_true_positions(speed, turn, turn_s, seed):
    rng = np.random.default_rng(seed)
    distance = rng.uniform(5, 50, 20)
    bearing = rng.uniform(-2.7, 2.7, 20)  # off the seam
    xyz = np.c_[distance * np.cos(bearing), distance * np.sin(bearing), rng.uniform(-1, 1, 20)]
    before, stamp = (constant_turn_pose(t, speed, turn) for t in (-PERIOD_S, 0.0))
    T = se3(rotation_zyx(0, 0, 0.7), np.array([3.0, -2.0, 0.0]))
    motion = PlanarMotion.between(before, stamp, PERIOD_S)
    seen = transform(T, skewed_points(xyz, 0.0, turn_s, speed, turn)[0])[:, :2]
    deskewed = seen + Placement(T, motion, turn_s).deskew(seen)
    np.testing.assert_allclose(deskewed, transform(T, xyz)[:, :2], atol=2e-3)  # arcs by their chords, of two degrees
    assert not Placement(T, motion).deskew(seen).any()


def one(x, y, length):
    """One proposal, by what its delay depends on."""
    return replace(Proposals.empty(), centroid=np.array([[x, y, 0.0]]), box=np.array([[x, y, 0.0, length, 0, 1, 0]]))


@pytest.mark.parametrize("towards", [0.0, 0.5 * np.pi, -0.75 * np.pi, np.pi])
@given(st.floats(2, 30), st.floats(-0.999, 0.999), st.floats(0.2, 4), st.sampled_from([1.0, -0.1]))
def test_the_delay_is_the_mean_over_the_bearings_also_across_the_seam(towards, distance, side, length, turn_s):
    """It is zero ahead, and its sign follows the rotation."""
    wide = np.arctan2(length / 2, distance)
    bearing = towards + side * wide
    parts = np.linspace(bearing - wide, bearing + wide, 20001)
    mean = np.angle(np.exp(1j * parts)).mean()
    seen = one(distance * np.cos(bearing), distance * np.sin(bearing), length)
    found = delays(seen.centroid, seen.box, turn_s)[0]
    assert found == pytest.approx(-turn_s * mean / (2 * np.pi), abs=1e-3)


def drive(turn_s, known, posed=False, frames=25, speed=8.0, turn=0.6, mid_rad=0.0):
    """Odometry and tracker after a drive with skewed sweeps, at a speed [m/s] and a turn [rad/s]; the true pose."""
    tracker = Follower()
    for i in range(frames):
        frame, proposals = skewed(street(n=60), i, turn_s, speed, turn, posed, mid_rad)
        tracker.follow(replace(frame, turn_s=turn_s if known else 0.0), proposals)
    return tracker, constant_turn_pose((frames - 1) * PERIOD_S, speed, turn)


@pytest.mark.parametrize("turn_s", [0.1, -0.1])
def test_the_path_is_found_through_skewed_sweeps(turn_s):
    turn_deg = {}
    for known in (True, False):
        tracker, T = drive(turn_s, known, frames=20)
        error = inverse(T) @ tracker.T_world_sensor
        turn_deg[known] = abs(np.rad2deg(yaw_of(error)))
        # Of 15 m; a sweep is registered a second time where the first one moves it far.
        assert not known or np.hypot(*error[:2, 3]) < 0.08
    assert turn_deg[True] < min(0.3, turn_deg[False] / 2)


@pytest.mark.parametrize("turn", [np.pi, -np.pi, 3.9])
def test_a_robot_that_spins_from_the_first_sweep_on_keeps_its_place(turn):
    """The first sweep is not deskewed, since no motion is known."""
    tracker, T = drive(0.1, known=True, frames=12, speed=0.0, turn=turn)
    error = inverse(T) @ tracker.T_world_sensor
    assert np.hypot(*error[:2, 3]) < 0.1
    assert abs(yaw_of(error)) < np.deg2rad(2.0)


def placed_apart_m(tracker):
    """(60,) distances of the tracks of the street's objects from their true places [m]."""
    assert len(tracker.tracks) == 60
    return np.hypot(*(centres(tracker.tracks.kdop.T)[::2] - street(n=60)[:, :2].T))


def test_stationary_objects_stay_in_place_though_their_sweeps_are_skewed():
    tracker, _ = drive(0.1, known=True, posed=True)
    distance_m = placed_apart_m(tracker)
    assert np.median(distance_m) < 0.05
    assert distance_m.max() < 0.3


@pytest.mark.parametrize("mid_rad", [np.pi, 2.0, -2.0])
def test_stationary_objects_stay_in_place_wherever_the_sweep_is_cut(mid_rad):
    """Straight ahead, as the ROS 2 driver of Velodyne does, or aside."""
    tracker, _ = drive(0.1, known=True, posed=True, speed=6.0, turn=0.2, mid_rad=mid_rad)
    assert np.quantile(placed_apart_m(tracker), 0.9) < 0.08
