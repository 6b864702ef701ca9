"""A scene seen by a head that turns while its carrier moves is put back where it stands."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from modt.config import TrackingConfig
from modt.geometry import inverse, rotation_zyx, se3, yaw_of
from modt.observations import observe
from modt.odometry.deskew import Motion, SweepSkew, delays
from modt.odometry.registration import Registration
from modt.tracking.states import EFFICIENT
from modt.types import Frame, Proposals
from tests.odometry.test_registration import street
from tests.tracking.tracking_scenes import Follower, box, frame_of
from tools.study.sweep_skew import displacement_m

PERIOD_S = 0.1


def pose(time_s, speed, turn):
    """A sensor that drives at one speed and turns at one rate, from rest at the origin."""
    c, yaw = way(time_s, speed, turn)
    return se3(rotation_zyx(0, 0, yaw), np.array([c.real, c.imag, 0.0]))


def way(time_s, speed, turn):
    """Place (complex) and heading, at one time or many."""
    yaw = turn * np.asarray(time_s)
    return speed * np.asarray(time_s) * np.exp(0.5j * yaw) * np.sinc(yaw / (2 * np.pi)), yaw


def seen_late(xyz, time_s, turn_s, speed, turn):
    """(n, 3) points of the world as a turning head sees them, each from where the sensor is when it looks there.

    That time is the bearing's, which depends on the time: found by repetition. And (n,) the times after the stamp.
    """
    place, late = xyz[:, 0] + 1j * xyz[:, 1], np.zeros(len(xyz))
    for _ in range(30):
        c, yaw = way(time_s + late, speed, turn)
        local = (place - c) * np.exp(-1j * yaw)
        late = -turn_s * np.angle(local) / (2 * np.pi)
    return np.c_[local.real, local.imag, xyz[:, 2]], late


def skewed(boxes, index, turn_s, speed, turn, posed):
    """A frame of boxes of the world (P, 7) as such a head sees them."""
    frame, proposals = frame_of(boxes, index, points=80)
    xyz, _ = seen_late(frame.points[:, :3].astype(np.float64), index * PERIOD_S, turn_s, speed, turn)
    groups = np.split(xyz, proposals.offsets[1:-1])
    centroid = np.array([g.mean(axis=0) for g in groups])
    local = boxes.copy()
    local[:, :3] = centroid
    local[:, 6] -= turn * index * PERIOD_S
    T = pose(index * PERIOD_S, speed, turn) if posed else None
    frame = replace(frame, points=np.c_[xyz, frame.points[:, 3]].astype(np.float32), T_world_sensor=T, turn_s=turn_s)
    return frame, replace(proposals, coordinates=xyz.T.astype(np.float32), centroid=centroid, box=local)


@given(st.floats(-20, 20), st.floats(-2.5, 2.5), st.sampled_from([0.1, -0.1, 0.05]), st.integers(0, 2**16))
def test_points_are_put_back_where_they_stand(speed, turn, turn_s, seed):
    rng = np.random.default_rng(seed)
    xyz = np.c_[rng.uniform(-40, 40, (20, 2)), rng.uniform(-1, 1, 20)]
    xyz = xyz[(np.hypot(xyz[:, 0], xyz[:, 1]) > 5) & (np.abs(np.arctan2(xyz[:, 1], xyz[:, 0])) < 2.7)]  # off the seam

    def at(t):
        return pose(t, speed, turn)

    local, late = seen_late(xyz, 0.0, turn_s, speed, turn)
    motion = Motion.between(at(-PERIOD_S), at(0.0), PERIOD_S)
    mended = local[:, :2] + motion.displacement(local[:, :2], late)
    np.testing.assert_allclose(mended, xyz[:, :2], atol=2e-3)  # arcs by their chords, of two degrees


def one(x, y, length, width):
    """A proposal at a place."""
    return Proposals(
        np.arange(4),
        np.array([0, 4]),
        np.zeros((3, 4), np.float32),
        np.array([[x, y, 0.0]]),
        np.array([[x, y, 0.0, length, width, 1.0, 0.0]]),
        np.zeros(1, np.bool_),
    )


@pytest.mark.parametrize(
    ("x", "y", "share"), [(10, 0, 0.0), (0, 10, -0.25), (0, -10, 0.25), (-7, 7, -0.375), (-7, -7, 0.375)]
)
def test_the_head_turns_clockwise_and_looks_ahead_at_the_stamp(x, y, share):
    assert delays(one(x, y, 1.0, 1.0), 0.1)[0] == pytest.approx(0.1 * share)
    assert delays(one(x, y, 1.0, 1.0), -0.1)[0] == pytest.approx(-0.1 * share)


@given(st.floats(2, 30), st.floats(-0.999, 0.999), st.floats(0.2, 4))
def test_what_lies_across_the_seam_is_seen_at_the_mean_time_of_its_parts(distance, side, length):
    wide = np.arctan2(length / 2, distance)
    bearing = np.pi + side * wide  # the seam is within it
    parts = np.linspace(bearing - wide, bearing + wide, 20001)
    mean = np.angle(np.exp(1j * parts)).mean()
    found = delays(one(distance * np.cos(bearing), distance * np.sin(bearing), length, 0.0), 1.0)[0]
    assert found == pytest.approx(-mean / (2 * np.pi), abs=1e-3)


@given(st.floats(0, 20), st.floats(-1, 1), st.floats(-1, 1), st.floats(-0.2, 0.2), st.sampled_from([0.1, -0.1]))
def test_what_was_seen_goes_by_its_share_of_a_correction(speed, turn, faster, turns_more, turn_s):
    """Placement it anew by the corrected pose, and by the motion that led there, moves it as far."""
    proposals = skewed(np.array([box(12, 4), box(-3, 8), box(-9, -9), box(2, -6)]), 0, turn_s, 0, 0, True)[1]
    skew, before = SweepSkew.of(proposals, turn_s), pose(0, 0, 0)

    def place(after):
        step = skew.step(Motion.between(before, after, PERIOD_S), after)
        return observe(proposals, after).centroid + step

    predicted, after = pose(PERIOD_S, speed, turn), pose(PERIOD_S, speed + faster, turn + turns_more)
    placed = np.c_[place(predicted), np.zeros((4, 2))] + [0, 0, 0, 1]
    whole = (placed @ (after @ inverse(predicted)).T - placed)[:, :2]
    expected = skew.share(PERIOD_S)[:, None] * whole
    np.testing.assert_allclose(place(after) - place(predicted), expected, atol=0.01)


@pytest.mark.parametrize(("told", "least_deg", "most_deg"), [(True, 0.0, 0.02), (False, 0.03, 1.0)])
def test_a_registration_that_is_told_the_shares_is_right_at_once(told, least_deg, most_deg):
    tracker, world = Follower(TrackingConfig(), EFFICIENT), street(n=120)
    for i in range(6):
        tracker.follow(*skewed(world, i, 0.1, 8.0, 0.6, posed=True))
    frame, proposals = skewed(world, 6, 0.1, 8.0, 0.6, posed=True)
    before, true, skew = pose(0.5, 8.0, 0.6), frame.T_world_sensor, SweepSkew.of(proposals, 0.1)
    predicted = true @ se3(rotation_zyx(0, 0, 0.01), np.array([0.2, 0.0, 0.0]))
    step = skew.step(Motion.between(before, predicted, PERIOD_S), predicted)
    share = skew.share(PERIOD_S) if told else 1.0
    found = Registration().correct(tracker.tracks, observe(proposals, predicted).moved(step), share) @ predicted
    assert least_deg <= abs(np.rad2deg(yaw_of(inverse(true) @ found))) < most_deg


@pytest.mark.parametrize("turn_s", [0.1, -0.1])
def test_proposals_are_where_their_points_are_one_by_one(turn_s):
    """What moving a proposal as a whole leaves, against its points each by its own time."""
    speed, turn = 10.0, 0.3

    def at(t):
        return pose(t, speed, turn)

    world = np.array([box(12, 4), box(-3, 8), box(-14, 4), box(-9, -9), box(2, -6), box(25, -12)])
    frame, proposals = skewed(world, 0, turn_s, speed, turn, posed=True)
    skew = SweepSkew.of(proposals, turn_s)
    mended = observe(proposals, at(0)).moved(skew.step(Motion.between(at(-PERIOD_S), at(0), PERIOD_S), at(0)))
    true_frame, true_proposals = frame_of(world, 0, points=80)
    true = observe(true_proposals, np.eye(4))
    raw = observe(proposals, at(0))
    assert np.abs(mended.centroid - true.centroid).max() < 0.03
    assert np.abs(mended.kdop - true.kdop).max() < 0.08
    assert np.abs(raw.centroid - true.centroid).max() > 0.3
    np.testing.assert_allclose(mended.box[:, :2] - raw.box[:, :2], mended.centroid - raw.centroid)
    assert len(frame.points) == len(true_frame.points)


def test_no_time_is_no_motion():
    assert Motion.between(np.eye(4), pose(1.0, 10.0, 0.5), 0.0) == Motion()
    step = Motion().displacement(np.array([[3.0, 4.0]]), np.array([0.05]))
    np.testing.assert_array_equal(step, 0)


def drive(turn_s, known, posed=False, frames=25):
    """The tracker after a drive of 8 m/s that turns at 35 degrees a second, its sweeps skewed."""
    tracker = Follower(TrackingConfig(), EFFICIENT)

    for i in range(frames):
        frame, proposals = skewed(street(n=60), i, turn_s, 8.0, 0.6, posed)
        tracker.follow(replace(frame, turn_s=turn_s if known else 0.0), proposals)
    return tracker, pose((frames - 1) * PERIOD_S, 8.0, 0.6)


@pytest.mark.parametrize("turn_s", [0.1, -0.1])
def test_the_sensors_way_is_found_through_skewed_sweeps(turn_s):
    off = []
    for known in (True, False):
        tracker, T = drive(turn_s, known)
        error = inverse(T) @ tracker.T_world_sensor
        off.append((abs(np.rad2deg(yaw_of(error))), np.hypot(*error[:2, 3])))
    assert off[0][0] < 0.3
    assert off[0][1] < 0.02 * 8 * 2.4
    assert off[1][0] > 2 * off[0][0]


def test_what_stands_stays_where_it_is_though_its_sweeps_are_skewed():
    """By poses that are given; the first frame, of which no motion is known yet, is mended by the second."""
    for frames in (2, 25):
        tracker, _ = drive(0.1, known=True, posed=True, frames=frames)
        t = tracker.tracks
        assert len(t) == 60
        place = street(n=60)[:, :2]
        near = np.hypot(*(t.kdop[:, [0, 2]] / 2 - t.kdop[:, [4, 6]] / 2 - place).T)
        assert np.median(near) < 0.05
        assert near.max() < 0.3
    first, _ = drive(0.1, known=True, posed=True, frames=1)
    assert first.tracks.age.max() == 1


def test_sweeps_seen_at_once_are_left_as_they_are():
    trackers = [Follower(TrackingConfig(), EFFICIENT) for _ in range(2)]
    for i in range(8):
        T = pose(0.1 * i, 8.0, 0.6)
        frame, proposals = frame_of(street(n=30), i, None if i % 2 else T, points=40)
        trackers[0].follow(frame, proposals)
        trackers[1].follow(
            Frame(frame.index, frame.stamp_s, frame.points, frame.T_world_sensor, turn_s=0.0), proposals
        )
        for (name, a), (_, b) in zip(trackers[0].tracks.columns(), trackers[1].tracks.columns(), strict=True):
            assert a.tobytes() == b.tobytes(), name


@given(st.floats(-0.4, 0.4), st.floats(-0.4, 0.4))
def test_compensation_is_told_by_the_bearings_at_edges(left_m, right_m):
    bearing = np.deg2rad(np.arange(0, 360, 0.2))
    distance = np.where(np.arange(len(bearing)) // 7 % 2, 6.0, 20.0)
    x, y = distance * np.cos(bearing), distance * np.sin(bearing)
    points = np.stack([x + np.where(y > 0, left_m, right_m), y, 0 * x, 0 * x], axis=1).astype(np.float32)
    assert displacement_m(points, 90.0)[0] == pytest.approx(left_m, abs=0.02)
    assert displacement_m(points, -90.0)[0] == pytest.approx(right_m, abs=0.02)
    assert np.isnan(displacement_m(points[:0], 90.0)[0])
