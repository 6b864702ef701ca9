"""Odometry with wrong poses: single ones cost no frame its pose, a new sequence of poses is followed."""

import numpy as np
import pytest

from modt.config import OdometryConfig
from modt.geometry import rotation_zyx, se3
from modt.poses.received_poses import ReceivedPoses
from modt.sources.pose_buffer import PoseBuffer
from modt.types import Frame

CONFIG = OdometryConfig()
EMPTY = np.zeros((0, 4), np.float32)
PERIOD_S = 0.1
SPEED_MPS = 12.0
KINDS = {  # wrong poses, and the reason of their refusal
    "far ahead": (lambda t, x: (t + 59.0, x, 0.0), "early"),
    "beyond any lead": (lambda t, x: (t + 3e5, x, 0.0), "ahead"),
    "ahead": (lambda t, x: (t + 1.5, x, 0.0), "early"),
    "a little ahead": (lambda t, x: (t + 0.2, x, 0.0), "leap"),
    "behind": (lambda t, x: (t - 0.15, x, 0.0), "out_of_order"),
    "far behind": (lambda t, x: (t - 100.0, x, 0.0), "stale"),
    "teleported": (lambda t, x: (t, x + 80.0, 0.0), "leap"),
    "teleported a little": (lambda t, x: (t, x - 2.0, 0.0), "leap"),
    "turned": (lambda t, x: (t, x, 2.0), "leap"),
    "turned a little": (lambda t, x: (t, x, 0.3), "leap"),
}


class Odometry(ReceivedPoses):
    """Receives what is in its list: stamps [s], x [m] and headings [rad]."""

    def __init__(self):
        super().__init__(CONFIG, "test")
        self.waiting = []

    def _take(self):
        taken = self.waiting
        self.waiting = []
        return taken

    def _read(self, message):
        stamp_s, x, yaw = message
        return stamp_s, se3(rotation_zyx(0.0, 0.0, yaw), np.array([x, 0.0, 0.0]))


class Robot:
    """A robot that drives straight on. Its sender and its sensor have clocks of their own; the test sets the time."""

    def __init__(self, rate_hz=50.0):
        self.odometry = Odometry()
        self.interval_s = 1.0 / rate_hz
        self.time_s = 0.0
        self.sent = 0
        self.sender_s = self.sensor_s = 0.0  # what they are off
        self.origin_m = 0.0  # of the sender's world

    def send(self, wrong=None):
        """Send the next pose, changed by `wrong`."""
        self.sent += 1
        self.time_s = self.sent * self.interval_s
        true = self.time_s + self.sender_s, self.origin_m + SPEED_MPS * self.time_s
        self.odometry.waiting.append(wrong(*true) if wrong else (*true, 0.0))

    def frame_error_m(self):
        """Error of the pose at a frame now, NaN without one; a turn counts at a distance of 5 m."""
        T = self.odometry.place(Frame(0, self.time_s + 0.003 + self.sensor_s, EMPTY)).T_world_sensor
        if T is None:
            return np.nan
        off = T[:3, 3] - [self.origin_m + SPEED_MPS * (self.time_s + 0.003), 0.0, 0.0]
        return np.linalg.norm(off) + 5 * abs(np.arctan2(T[1, 0], T[0, 0]))

    def drive(self, seconds):
        """Errors of the frames [m], NaN without a pose."""
        errors = []
        for _ in range(round(seconds / PERIOD_S)):
            until = self.time_s + PERIOD_S - 1e-9
            while self.time_s < until:
                self.send()
            errors.append(self.frame_error_m())
        return np.array(errors)


@pytest.fixture(name="robot", params=[20.0, 50.0, 400.0], ids="{:.0f} Hz".format)
def a_robot(request):
    return Robot(request.param)


@pytest.mark.parametrize("kind", KINDS)
def test_one_wrong_pose_costs_no_frame_its_pose(robot, kind):
    wrong, reason = KINDS[kind]
    assert robot.drive(1.0)[2:].max() < 0.01
    before = robot.odometry.report()
    assert before["used"] == robot.sent
    robot.send(wrong)
    assert robot.drive(2.0).max() < 0.01
    report = robot.odometry.report()
    assert report["refused"] == before["refused"] | {reason: 1}
    assert report["used"] == robot.sent - 1
    assert report["restarts"] == 0


@pytest.mark.parametrize("kind", KINDS)
def test_a_sender_that_begins_with_a_wrong_pose_is_believed_within_a_second(robot, kind):
    robot.send(KINDS[kind][0])
    errors = robot.drive(2.0)
    assert errors[3:].max() < 0.01


@pytest.mark.parametrize("far_s", [-1e300, 1e300, -1e11, 1.7e18, 5e-324])
def test_no_stamp_ends_what_follows(robot, far_s):
    robot.drive(1.0)
    for _ in range(50):
        robot.send()
        robot.send(lambda t, x: (far_s, x, 0.0))
        robot.send(lambda t, x: (t - 5.0, x, 0.0))
        robot.frame_error_m()
    assert robot.odometry.refused["failed"] == 0
    assert robot.drive(2.0)[10:].max() < 0.01


@pytest.mark.parametrize("broken", ["_read", "_keep", "_take"])
def test_a_source_that_fails_costs_poses_and_recovers(robot, broken, monkeypatch, caplog):
    robot.drive(1.0)

    def fail(*_):
        raise ZeroDivisionError("by nought")

    monkeypatch.setattr(robot.odometry, broken, fail)
    assert np.isnan(robot.drive(1.0)[4:]).all()
    assert robot.odometry.refused["failed"] >= 10
    assert caplog.text.count("ZeroDivisionError: by nought; frames have no pose until it works") == 1
    monkeypatch.undo()
    assert robot.drive(2.0)[3:].max() < 0.01
    assert robot.odometry.restarts == 0


@pytest.mark.parametrize(("clock_s", "factor", "unit"), [(1.7e9, 1e9, "nanoseconds"), (100.0, 1e3, "milliseconds")])
def test_the_unit_of_stamps_that_are_no_seconds_is_named(clock_s, factor, unit, caplog):
    robot = Robot()
    robot.sent = round(clock_s / robot.interval_s)
    for _ in range(10):
        robot.send(lambda t, x: (t * factor, 0.0, 0.0))
        robot.frame_error_m()
    assert robot.odometry.refused["unit"] == 10
    assert caplog.text.count(f"it seems to be in {unit}; give seconds") == 1


@pytest.mark.parametrize("step_s", [-30.0, -0.5, -0.15, 0.15, 0.5, 30.0])
def test_a_step_of_the_clock_of_both_is_followed(robot, step_s):
    robot.drive(1.0)
    robot.sender_s = robot.sensor_s = step_s
    errors = robot.drive(2.0)
    assert errors[5:].max() < 0.01
    assert robot.odometry.restarts == 0


def test_a_step_of_the_senders_clock_alone_is_followed_but_gives_no_pose(robot):
    robot.drive(1.0)
    robot.sender_s = 5.0
    assert np.isnan(robot.drive(2.0)[5:]).all()
    used = robot.odometry.used
    robot.drive(1.0)
    assert robot.odometry.used - used == round(1.0 / robot.interval_s)
    robot.sender_s = 0.0  # set right again
    assert robot.drive(2.0)[5:].max() < 0.01
    assert robot.odometry.restarts == 0


def test_a_sender_that_restarts_elsewhere_is_followed_and_the_first_time_is_logged(robot, caplog):
    robot.drive(1.0)
    for restarts in (1, 2):
        robot.origin_m -= 100.0
        errors = robot.drive(1.0)
        assert errors[0] == pytest.approx(100.0, abs=0.1)  # in the world before
        assert errors[5:].max() < 0.01
        assert robot.odometry.restarts == restarts
    assert caplog.text.count("odometry.max_speed_mps") == 1


def test_no_pose_is_refused_after_a_silence_of_the_sender(robot):
    robot.drive(1.0)
    robot.sent += round(5.0 / robot.interval_s)
    assert np.nanmax(robot.drive(1.0)) < 0.01
    assert sum(robot.odometry.refused.values()) == 0


@pytest.mark.parametrize("far_m", [1e155, -1e308])
def test_a_distance_beyond_all_numbers_is_a_leap(far_m):
    buffer = PoseBuffer(CONFIG)
    T = np.eye(4)
    T[0, 3] = far_m
    buffer.add(0.0, np.eye(4))
    assert buffer.leaps(0.1, T)
