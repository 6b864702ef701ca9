from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from modt.config import TrackingConfig
from modt.geometry import inverse, rotation_zyx, se3, transform_boxes, yaw_of
from modt.geometry.kdop import DIRECTIONS
from modt.observations import observe
from modt.odometry import landmarks
from modt.odometry.registration import GATE_M, REACH_M, SCALES, Fit, Registration, _fit, _mutual
from modt.tracking.states import EFFICIENT
from modt.tracking.track_table import TrackTable
from modt.tracking.tracker import rigid
from tests.tracking.tracking_scenes import Follower, frame_of


def street(seed=0, n=40):
    rng = np.random.default_rng(seed)
    place = rng.uniform([-20, -25], [60, 25], (n, 2))
    size = rng.uniform(0.3, 2.0, (n, 2))
    return np.c_[place, np.full(n, -1.0), size.max(axis=1), size.min(axis=1), np.full(n, 1.5), rng.uniform(-3, 3, n)]


def drive(i):
    yaw = 0.008 * i
    return se3(rotation_zyx(0, 0, yaw), np.array([0.8 * i, 0.003 * i * i, 0.0]))


def follow(n, moving=0, posed=False):
    tracker = Follower(TrackingConfig(), EFFICIENT)
    world = street()
    for i in range(n):
        now = world.copy()
        now[:moving, 0] += 1.2 * i
        T = drive(i)
        tracker.follow(*frame_of(transform_boxes(inverse(T), now), i, T if posed else None, points=150))
    return tracker


def test_the_sensors_way_is_found_among_what_stands():
    tracker = follow(30)
    error = inverse(drive(29)) @ tracker.T_world_sensor
    assert np.hypot(*error[:2, 3]) < 0.02 * 0.8 * 29
    assert abs(np.rad2deg(yaw_of(error))) < 0.3
    assert len(tracker.tracks) == 40


def test_a_third_that_moves_does_not_mislead():
    tracker = follow(20, moving=13)
    error = inverse(drive(19)) @ tracker.T_world_sensor
    assert np.hypot(*error[:2, 3]) < 0.03 * 0.8 * 19
    assert abs(np.rad2deg(yaw_of(error))) < 0.5


def test_a_pose_that_is_given_is_taken():
    np.testing.assert_array_equal(follow(3, posed=True).T_world_sensor, drive(2))


def test_odometry_that_fails_for_a_while_is_bridged():
    tracker, world = Follower(TrackingConfig(), EFFICIENT), street()
    for i in range(20):
        T = drive(i)
        frame = frame_of(transform_boxes(inverse(T), world), i, None if 8 <= i < 14 else T, points=150)
        tracker.follow(*frame)
    assert len(tracker.tracks) == 40
    assert tracker.tracks.age.min() == 20


def test_odometry_that_begins_late_finds_the_tracks_where_they_are():
    tracker, world = Follower(TrackingConfig(), EFFICIENT), street()
    T_elsewhere = se3(rotation_zyx(0, 0, 2.0), np.array([400.0, -90.0, 0.0]))
    for i in range(20):
        T = None if i < 6 or i in (12, 13) else T_elsewhere @ drive(i)
        tracker.follow(*frame_of(transform_boxes(inverse(drive(i)), world), i, T, points=150))
    assert len(tracker.tracks) == 40
    assert tracker.tracks.age.min() == 20
    np.testing.assert_allclose(tracker.T_world_sensor, drive(19), atol=0.15)


def test_odometry_that_begins_anew_moves_no_track():
    tracker, world = Follower(TrackingConfig(), EFFICIENT), street()
    for i in range(20):
        T = drive(i) if i < 8 else None if i in (8, 9) else inverse(drive(10)) @ drive(i)
        frame, proposals = frame_of(transform_boxes(inverse(drive(i)), world), i, T, points=150)
        tracker.follow(replace(frame, restarts=int(i >= 8)), proposals)
    assert len(tracker.tracks) == 40
    assert tracker.tracks.age.min() == 20
    np.testing.assert_allclose(tracker.T_world_sensor, drive(19), atol=0.15)


def test_a_first_pose_far_from_the_origin_is_no_motion():
    tracker, world = Follower(TrackingConfig(), EFFICIENT), street()
    T_elsewhere = se3(rotation_zyx(0, 0, 2.0), np.array([400.0, -90.0, 0.0]))
    for i in range(4):
        T = T_elsewhere @ drive(0) if i == 0 else None
        tracker.follow(*frame_of(transform_boxes(inverse(drive(i)), world), i, T, points=150))
    assert len(tracker.tracks) == 40
    np.testing.assert_allclose(tracker.T_world_sensor, T_elsewhere @ drive(3), atol=0.15)


def test_without_landmarks_the_sensor_goes_on_as_it_went():
    tracker = follow(10)
    before = tracker.T_world_sensor.copy()
    tracker.follow(*frame_of([], 10, None))
    step = inverse(before) @ tracker.T_world_sensor
    np.testing.assert_allclose(step, inverse(drive(8)) @ drive(9), atol=0.05)


def test_products_of_poses_stay_rigid():
    T = drive(3)
    T[:3, :3] *= 1.01
    R = rigid(T)[:3, :3]
    np.testing.assert_allclose(R @ R.T, np.eye(3), atol=1e-12)


def outward(lever):
    """(3, 8, K) how far x, y and a turn take each end of outlines at the ends of levers (K, 2), one by one."""
    out = np.zeros((3, 8, len(lever)))
    for k, (x, y) in enumerate(lever):
        for e in range(8):
            out[:, e, k] = DIRECTIONS[0, e], DIRECTIONS[1, e], DIRECTIONS[0, e] * -y + DIRECTIONS[1, e] * x
    return out


def slow_fit(gain, ways, variance, motion, scales):
    """Gains + ways * motion = 0, an equation an end, solved as such, reweighted by the residuals."""
    design, sigma2 = ways.reshape(3, -1).T, np.tile(variance, 8)
    for scale in scales:
        w = 1 / ((gain.ravel() + design @ motion) ** 2 + scale**2 * sigma2)
        little = np.sqrt(1e-6 * (w[:, None] * design**2).sum()) * np.eye(3)
        rows = np.concatenate([np.sqrt(w)[:, None] * design, little])
        motion = -np.linalg.lstsq(rows, np.append(np.sqrt(w) * gain.ravel(), np.zeros(3)))[0]
    return motion


@given(st.integers(3, 40), st.integers(0, 2**16))
def test_the_fit_is_weighted_least_squares(n, seed):
    rng = np.random.default_rng(seed)
    gain, variance = rng.normal(0, 0.3, (8, n)), rng.uniform(0.01, 0.1, n) ** 2
    problem = gain, outward(rng.uniform(-60, 60, (n, 2))), variance, rng.normal(0, 0.1, 3)
    for scales in (SCALES[:1], SCALES):
        np.testing.assert_allclose(_fit(*problem, scales), slow_fit(*problem, scales), rtol=1e-5, atol=1e-8)


@given(st.integers(0, 2**16))
def test_ends_that_come_into_view_do_not_mislead(seed):
    """One end of every axis tells how the sensor moved, the other, whichever, came into view."""
    rng = np.random.default_rng(seed)
    ways, motion = outward(rng.uniform(-40, 40, (30, 2))), rng.uniform(-1, 1, 3) * [0.3, 0.3, 0.01]
    gain = -np.tensordot(motion, ways, 1) + rng.normal(0, 0.01, (8, 30))
    ahead = rng.random((4, 30)) < 0.5
    gain += np.concatenate([ahead, ~ahead]) * rng.exponential(0.5, (8, 30))
    off = _fit(gain, ways, np.full(30, 0.02**2), np.zeros(3), SCALES) - motion
    assert np.abs(off).max() < 0.02
    assert abs(off[2]) < 0.001


@given(st.integers(0, 30), st.integers(0, 2**16))
def test_mutual_pairs_are_the_best_of_both(n, seed):
    rng = np.random.default_rng(seed)
    i, j, cost = rng.integers(0, 6, n), rng.integers(0, 6, n), rng.integers(0, 8, n) / 8.0

    def first_of(index, k):  # of equals the first
        return min(np.flatnonzero(index == index[k]), key=lambda p: (cost[p], p)) == k

    assert _mutual(i, j, cost).tolist() == [k for k in range(n) if first_of(i, k) and first_of(j, k)]


def test_a_turn_that_begins_and_ends_at_once_is_followed():
    """The prediction is off by metres far away when it begins; pairs are then sought farther away."""
    tracker, yaw, x, y = Follower(TrackingConfig(), EFFICIENT), 0.0, 0.0, 0.0
    world = street()
    for i in range(30):
        yaw += 0.08 if 10 <= i < 20 else 0.0
        x, y = x + 0.8 * np.cos(yaw), y + 0.8 * np.sin(yaw)
        T = se3(rotation_zyx(0, 0, yaw), np.array([x, y, 0.0]))
        if i == 0:
            T_first = T
        tracker.follow(*frame_of(transform_boxes(inverse(T), world), i, None, points=150))
    error = inverse(inverse(T_first) @ T) @ tracker.T_world_sensor
    assert abs(np.rad2deg(yaw_of(error))) < 0.6
    assert np.hypot(*error[:2, 3]) < 0.3


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_a_turn_that_begins_too_suddenly_to_be_found_at_once_is_sought_again(seed):
    tracker, world, yaw, x, y = Follower(TrackingConfig(), EFFICIENT), street(seed, 150), 0.0, 0.0, 0.0
    for i in range(14):
        yaw += 0.1 if i >= 10 else 0.0
        x, y = x + 0.8 * np.cos(yaw), y + 0.8 * np.sin(yaw)
        T = se3(rotation_zyx(0, 0, yaw), np.array([x - 0.8, y, 0.0]))  # from the origin
        tracker.follow(*frame_of(transform_boxes(inverse(T), world), i, None, points=60))
    error = inverse(T) @ tracker.T_world_sensor
    assert abs(np.rad2deg(yaw_of(error))) < 0.1
    assert np.hypot(*error[:2, 3]) < 0.05


@pytest.mark.parametrize("turn", [0.15, -0.15])
def test_a_sensor_that_turns_fast_from_the_outset_is_followed(turn):
    """Where nothing is known of the motion turns are tried: a vote among shifts alone would be led astray."""
    tracker, world = Follower(TrackingConfig(), EFFICIENT), street(n=150)
    for i in range(4):
        T = se3(rotation_zyx(0, 0, turn * i), np.zeros(3))
        tracker.follow(*frame_of(transform_boxes(inverse(T), world), i, None, points=60))
    error = inverse(T) @ tracker.T_world_sensor
    assert abs(np.rad2deg(yaw_of(error))) < 1.0
    assert np.hypot(*error[:2, 3]) < 0.3


@pytest.mark.parametrize(
    ("near", "far", "taken"),
    [
        ((28, 30), (29, 45), "near"),  # it agrees: nobody looks farther
        ((18, 30), (29, 45), "far"),  # too few of those near by agree
        ((10, 13), (29, 45), "far"),  # most do, but there were thirty a frame ago
        ((10, 13), (9, 45), "near"),  # they have gone, nothing better is farther off
    ],
)
def test_a_fit_of_a_few_is_doubted(near, far, taken, monkeypatch):
    registration, fits = Registration(), {GATE_M: Fit(np.full(3, 0.01), *near), REACH_M: Fit(np.full(3, 0.03), *far)}
    registration._begun = registration._settled = True
    registration._agreed = 30
    monkeypatch.setattr(registration, "_solve", lambda *arguments, choices: fits[arguments[4]])
    _, observations = frame_of([], 0, np.eye(4))
    motion = registration.correct(TrackTable.blank(), observe(observations, np.eye(4)))
    np.testing.assert_allclose(motion[0, 3], {"near": 0.01, "far": 0.03}[taken])


def test_the_error_of_one_frame_is_not_handed_on():
    """Landmarks keep to where they were seen on average, so a pose found wrongly does not move the world."""
    tracker, world = Follower(TrackingConfig(), EFFICIENT), street()
    rng = np.random.default_rng(5)
    for i in range(80):
        seen = transform_boxes(inverse(drive(0)), world)
        seen[:, :2] += rng.normal(0, 0.05, (len(seen), 2))  # every view jitters; the sensor stands
        tracker.follow(*frame_of(seen, i, None, points=150))
    assert abs(np.rad2deg(yaw_of(tracker.T_world_sensor))) < 0.05
    assert np.hypot(*tracker.T_world_sensor[:2, 3]) < 0.02


def test_landmarks_begin_anew_where_odometry_fails_again():
    """What drifted while poses were given does not leap back to where it stood before."""
    tracker, world = Follower(TrackingConfig(), EFFICIENT), street()
    for i in range(206):
        drifted = None if i < 6 else se3(np.eye(3), np.array([0.15 * (i - 6) / 199, 0.0, 0.0]))
        tracker.follow(*frame_of(world, i, drifted, points=150))
        assert i < 7 or not tracker.tracks.stationary_frames.any()
    left = tracker.T_world_sensor[0, 3]
    for i in range(206, 211):
        tracker.follow(*frame_of(world, i, None, points=150))
        assert abs(tracker.T_world_sensor[0, 3] - left) < 0.01
    assert tracker.tracks.stationary_frames.max() > 3


def test_the_mean_outline_is_the_mean_of_what_was_seen_since_it_stands():
    rng = np.random.default_rng(3)
    tracks, place, seen = TrackTable.blank(3), rng.uniform(5, 20, (3, 8)), []
    tracks.proposal[:2] = [1, 0]  # the third is not seen
    tracks.stationary[:] = True
    for _ in range(9):
        tracks.kdop[:] = place + rng.normal(0, 0.01, (3, 8))
        seen.append(tracks.kdop.copy())
        landmarks.keep(tracks)
        np.testing.assert_allclose(tracks.landmark_kdop[:2], np.mean(seen, axis=0)[:2], atol=1e-9)
    assert tracks.stationary_frames.tolist() == [9, 9, 0]
    assert not tracks.landmark_kdop[2].any()
    tracks.kdop[0, 2] += 0.5  # another end comes into view
    before = tracks.landmark_kdop.copy()
    landmarks.keep(tracks)
    assert tracks.landmark_kdop[0, 2] == tracks.kdop[0, 2]
    np.testing.assert_allclose(np.delete(tracks.landmark_kdop[0], 2), np.delete(before[0], 2), atol=0.01)
    tracks.stationary[:] = False
    for _ in range(8):  # it drives off: what it was seen as before is no landmark
        tracks.kdop[:] += 0.4
        landmarks.keep(tracks)
        np.testing.assert_array_equal(tracks.landmark_kdop[:2], tracks.kdop[:2])
    assert not tracks.stationary_frames.any()
