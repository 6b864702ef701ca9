"""A robot whose sensor, odometry, clocks and scheduler may lie or stop, up to the frames that its loop takes."""

from __future__ import annotations

import json
import logging
import time
from collections import Counter, deque
from collections.abc import Iterable, Sequence
from functools import cache
from typing import Any

import numpy as np

from modt.app.failures import OncePerSecond
from modt.config import OdometryConfig
from modt.poses.pose_socket import read_datagram
from modt.poses.pose_topic import PoseTopic
from modt.poses.received_poses import ReceivedPoses
from modt.ros2.odometry import write_odometry
from modt.ros2.point_cloud2 import write_cloud
from modt.sources.live.live_stream import LiveStream
from modt.sources.pose_buffer import CAPACITY, MAX_AGE_S, POSITION_NOISE_M
from modt.sources.stream import MAX_KEPT_FAULTS, Reception, StreamInfo, Sweep
from modt.types import Float64, Frame
from tests.sequences.makers import MAKERS, TURN_S, is_bounded

CONFIG = OdometryConfig()
SPEED_MPS = 5.0
POSES_A_TURN = 5
REACH_M = POSITION_NOISE_M + 2 * CONFIG.max_speed_mps * MAX_AGE_S
"""No pose of a frame is farther from every pose that was sent."""
MOST_KINDS = 60
MOST_REASONS = 40
MESSAGE_CPU_S = 0.004
"""CPU time that a message may take on average."""
SLACK_CPU_S = 1.0
"""CPU time that a whole step may take besides."""


@cache
def turns(maker: str) -> Sequence[Sequence[bytes]]:
    """The packets of one turn of each model of a maker."""
    return MAKERS[maker].turns()


class Datagrams(ReceivedPoses):
    """Poses of datagrams that a test hands over."""

    _read = staticmethod(read_datagram)  # type: ignore[assignment]

    def __init__(self) -> None:
        super().__init__(CONFIG, "datagrams")
        self.held: list[bytes] = []

    def _take(self) -> list[bytes]:
        taken = self.held[-CAPACITY:]
        self.held = []
        self.received += len(taken)
        return taken


class Held:
    """A subscription to the messages that a test hands over. It gives the latest ones."""

    def __init__(self, depth: int) -> None:
        self.depth = depth
        self.held = list[Any]()

    def take(self, timeout_s: float = 0.0) -> list[Any]:
        taken = self.held[-self.depth :]
        self.held = []
        return taken


class Lines(logging.Handler):
    """Counts of the lines that were logged, before and after they are held back, by kind."""

    def __init__(self, world: LiveWorld) -> None:
        super().__init__()
        self.said = Counter[str]()
        self.passed = Counter[tuple[str, float]]()
        self._world = world
        self._limit = OncePerSecond(lambda: world.now_s)

    def emit(self, record: logging.LogRecord) -> None:
        kind = f"{record.name} {record.msg}"
        self.said[kind] += 1
        assert len(record.getMessage()) < 10_000
        assert "Traceback" not in str(record.exc_info)
        self.passed[kind, self._world.now_s // 1.0] += self._limit.filter(record)


class Reader:
    """The reader of a source with its reception alone. The world hands the sweeps over."""

    profile = None

    def __init__(self) -> None:
        self.reception = Reception()


class LiveWorld:
    """The parts between a robot's sockets and its loop, without threads, on clocks of the test.

    Attributes:
        now_s: monotonic.
        set_s: time by which the calendar is ahead of it.
        sensor_s: time by which the clock of the sensor is ahead of it.
        origin_m: origin of the odometry.
    """

    def __init__(self, source: str, odometry: str) -> None:
        self.now_s = 100.0
        self.set_s = 1.6e9
        self.sensor_s = 0.0
        self.origin_m = np.zeros(2)
        self.source = source
        self.maker = MAKERS.get(source)
        self.payloads = turns(source)[0] if self.maker else ()
        self.decoder = self.maker.decoder() if self.maker else None
        self.reader: Any = Reader()
        if self.decoder:
            self.reader.reception = self.decoder.reception
        if source == "ros2":
            from modt.sources.live.ros2 import DEPTH, PointCloudReader

            self.clouds = Held(DEPTH)
            self.reader = PointCloudReader(self.clouds, "points")  # type: ignore[arg-type]
        info = StreamInfo("sensor", "test", 0, None, TURN_S, None, has_poses=False)
        self.stream = LiveStream(info, self.reader, clock=lambda: self.now_s)
        self.messages = 0
        self.frames = list[Frame]()
        self._taken: list[tuple[float, float]] = []
        self.sent: deque[tuple[float, float, float]] = deque(maxlen=2000)
        self.poses: Any = Datagrams() if odometry == "datagrams" else PoseTopic(Held(256), CONFIG, "odom", np.eye(4))  # type: ignore[arg-type]
        self._counts: dict[str, float] = {}
        self.lines = Lines(self)
        logging.getLogger("modt").addHandler(self.lines)

    def close(self) -> None:
        logging.getLogger("modt").removeHandler(self.lines)

    @property
    def calendar_s(self) -> float:
        return self.now_s + self.set_s

    def packet(self, payload: bytes, received_s: float | None = None) -> None:
        """Hand a packet to the port of the sensor."""
        self.messages += 1
        self.reader.reception.messages += 1
        received_s = self.calendar_s if received_s is None else received_s
        self._put(self.decoder.decode(received_s, payload))

    def stamped(self, payload: bytes, ahead_s: float = 0.0) -> bytes:
        """A packet with the time of the sensor's clock."""
        return self.maker.stamped(payload, self.now_s + self.sensor_s + ahead_s)

    def cloud(self, stamp_s: float, points: Any, frame_id: str = "lidar") -> None:
        """Hand a sweep to the topic."""
        from modt.ros2 import dds

        self.messages += 1
        seconds = min(max(stamp_s, -2e9), 2e9) if np.isfinite(stamp_s) else 0.0
        self.clouds.held.append(dds.Message(write_cloud(seconds, frame_id, points), self.calendar_s))
        self._put(self.reader.read(0.0))

    def pause(self) -> None:
        """Let a moment pass in which nothing arrives."""
        if self.decoder is not None:
            self._put(self.decoder.pause())

    def _put(self, sweeps: Iterable[Sweep]) -> None:
        for sweep in sweeps:
            self.stream._put(sweep)

    def pose(self, stamp_s: float, x_m: float, y_m: float = 0.0, yaw: float = 0.0) -> None:
        """Send a pose of the odometry."""
        self.messages += 1
        if np.isfinite([x_m, y_m]).all():
            self.sent.append((x_m, y_m, 0.0))
        if isinstance(self.poses, Datagrams):
            message = {"stamp": stamp_s, "x": x_m, "y": y_m, "yaw": yaw}
            self.poses.held.append(json.dumps(message).encode())
        elif abs(stamp_s) < 2e9 and np.isfinite([x_m, y_m, yaw]).all():
            from modt.ros2 import dds

            T = np.eye(4)
            T[:2, :2] = [[np.cos(yaw), -np.sin(yaw)], [np.sin(yaw), np.cos(yaw)]]
            T[:2, 3] = x_m, y_m
            self.poses._subscription.held.append(dds.Message(write_odometry(stamp_s, "odom", "base", T), stamp_s))

    def honest_pose(self, ahead_s: float = 0.0) -> None:
        """Send the pose of a robot that drives straight on."""
        x_m, y_m = self.origin_m + np.array([SPEED_MPS * (self.now_s + ahead_s), 0.0])
        self.pose(self.calendar_s + ahead_s, float(x_m), float(y_m))

    def take(self) -> None:
        """Let the loop take a sweep and place it."""
        received = self.stream.take(0.0)
        if received is None:
            return
        frame = self.poses.place(received.frame)
        self.frames = [*self.frames[-50:], frame]
        assert np.isfinite(frame.stamp_s)
        assert np.isfinite(frame.time_s)
        self._taken = [*self._taken[-50:], (received.arrived_s, frame.time_s)]
        if len(self._taken) > 1:
            (before_s, last_s), (arrived_s, time_s) = self._taken[-2:]
            assert -1e-6 <= time_s - last_s <= arrived_s - before_s + 1.1, "steady time stepped"
        if frame.T_world_sensor is not None:
            self._pose_is_near_what_was_sent(frame.T_world_sensor)

    def _pose_is_near_what_was_sent(self, T: Float64) -> None:
        assert np.isfinite(T).all()
        assert np.linalg.norm(np.array(self.sent) - T[:3, 3], axis=1).min() <= REACH_M, "a pose that nobody sent"

    def drive(self, turns: int, *, posed: bool = True, sensing: bool = True, faults: Any = None) -> None:
        """Send and take everything of some turns of the sensor; `faults` may change the packets of a turn."""
        for _ in range(turns):
            n = len(self.payloads)
            packets_ = [(k / n * TURN_S, payload, 0.0) for k, payload in enumerate(self.payloads)]
            packets_ = packets_ if faults is None else faults(packets_)
            began_s = self.now_s
            due = 0
            for at_s, payload, ahead_s in packets_ if sensing else []:
                self.now_s = max(self.now_s, began_s + at_s)
                self.packet(self.stamped(payload, ahead_s))
                if posed and at_s >= due / POSES_A_TURN * TURN_S:
                    self.honest_pose()
                    due += 1
            for _ in range(due, POSES_A_TURN if posed else 0):
                self.now_s += (began_s + TURN_S - self.now_s) / POSES_A_TURN
                self.honest_pose()
            self.now_s = max(self.now_s, began_s + TURN_S)
            if sensing and self.source == "ros2":
                self.cloud(self.calendar_s - 0.05, np.full((10, 4), 5.0, np.float32))
            self.pause()
            self.take()

    def check(self, cpu_s: float, messages: int) -> None:
        """Check the promises after a step, by its CPU time and its number of messages."""
        assert cpu_s < SLACK_CPU_S + MESSAGE_CPU_S * messages, "it took too long"
        self._bounded()
        counts = self._present_counts()
        for name, count in counts.items():
            assert count >= self._counts.get(name, 0), f"{name} fell"
        self._counts = counts
        assert max(self.lines.passed.values(), default=0) <= 1, "a log line more than once a second"
        assert len(self.lines.said) <= MOST_KINDS, "too many kinds of lines"

    def _present_counts(self) -> dict[str, float]:
        health = self.stream.health()
        report = self.poses.report()
        counts = {key: value for key, value in health.items() if isinstance(value, int)} | {"silent": 0}
        counts |= {f"refused {reason}": n for reason, n in health["refused_messages"].items()}
        counts |= {key: value for key, value in report.items() if isinstance(value, int)}
        counts |= {f"pose {reason}": n for reason, n in report["refused"].items()}
        assert report["refused"]["failed"] == 0
        assert len(health["refused_messages"]) <= MOST_REASONS
        return counts | {"faults": self.stream.faults.count}

    def _bounded(self) -> None:
        poses = self.poses._poses
        assert is_bounded(self.decoder)
        assert max(len(poses.accepted), len(poses._doubted)) <= CAPACITY
        assert len(self.stream.faults.first) <= MAX_KEPT_FAULTS

    def recovers(self) -> None:
        """Check that sweeps and their poses come again three seconds after the last fault."""
        self.drive(30)
        frames = self.stream.sweeps
        posed = self.poses.posed
        refused = self.stream.faults.skipped
        self.drive(10)
        assert self.stream.sweeps - frames >= 9, "blind"
        assert self.stream.faults.skipped - refused == 0, "sweeps are refused"
        assert self.poses.posed - posed >= 9, "without poses"


def cpu_s() -> float:
    """CPU time of this thread so far."""
    return time.thread_time()
