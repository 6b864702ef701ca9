"""sensor_msgs/PointCloud2 topics of ROS 2."""

from __future__ import annotations

import logging
import math
from collections import deque
from statistics import fmean

from modt import host
from modt.address import Address
from modt.ros2.address import domain_of, topic_of
from modt.ros2.cdr import MessageError
from modt.ros2.dds import Message, Subscription, participant
from modt.ros2.point_cloud2 import FOREIGN_FRAMES, OPTICAL, TYPE, PointCloud, read_cloud
from modt.sources.live.live_stream import LiveStream
from modt.sources.stream import Reception, StreamInfo, Sweep
from modt.sources.turn_parts import TurnParts

REMEMBERED = 32
NEEDED = 8
"""Number of steps between stamps that are kept, and number from which the period is known."""
LONGEST_S = 2.0
"""Greatest step between stamps [s]; beyond it the sensor was silent, or its clock was set."""


class MissingSweeps:
    """Counts the periods in which no sweep came."""

    def __init__(self) -> None:
        self._steps_s: deque[float] = deque(maxlen=REMEMBERED)
        self._last_s: float | None = None

    def before(self, stamp_s: float) -> int:
        """Number of sweeps missing between the last sweep and one of this stamp."""
        step_s = 0.0 if self._last_s is None else stamp_s - self._last_s
        self._last_s = stamp_s
        if not 0 < step_s < LONGEST_S:
            return 0
        self._steps_s.append(step_s)
        if len(self._steps_s) < NEEDED:
            return 0
        new = self._steps_s if len(self._steps_s) == NEEDED else (step_s,)
        lower_s = sorted(self._steps_s)[len(self._steps_s) // 4]  # single, even if half are missing
        period_s = fmean(known_s for known_s in self._steps_s if known_s < 1.5 * lower_s)
        return sum(max(round(step_s / period_s) - 1, 0) for step_s in new)


log = logging.getLogger(__name__)

WATCHED = 8
"""Number of messages by which it is known whether they are parts of turns."""
SILENT_S = 1.0
"""Time without messages of a sensor after which those of another one, in another frame, are followed [s]."""
DEPTH = 5
"""Number of sweeps that wait to be read, as in ROS 2's QoS for sensors."""


class PointCloudReader:
    """Turns messages of a topic into sweeps."""

    profile = None  # a message does not identify its sensor

    def __init__(self, subscription: Subscription, name: str) -> None:
        self.reception = Reception()
        self._subscription: Subscription | None = subscription
        self._name = name
        self._missing = MissingSweeps()
        self._seen_s = -math.inf  # time of the latest message of the sensor
        self._first: (
            list[tuple[PointCloud, float]] | None
        ) = []  # until it is known whether messages are parts of turns
        self._parts: TurnParts | None = None

    def read(self, timeout_s: float) -> list[Sweep]:
        """Sweeps received until the timeout, oldest first."""
        subscription = self._subscription
        if subscription is None:
            return []
        messages = subscription.take(timeout_s)
        if not messages:
            self.reception.silence = subscription.mismatch
        self.reception.messages += len(messages)
        sweeps = [sweep for message in messages for sweep in self._sweeps(message)]
        lost = sum(self._missing.before(sweep.stamp_s) for sweep in sweeps)
        if lost and not self.reception.lost:
            remedy = "raise net.core.rmem_max here, or check the network and the sender; later ones are only counted"
            log.warning("%s: sweeps are missing by their stamps; %s", self._name, remedy)
        self.reception.lost += lost
        return sweeps

    def close(self) -> None:
        """Leave the topic, once `read` has returned."""
        self._subscription = None

    def _sweeps(self, message: Message) -> list[Sweep]:
        """The sweep in a message, or that it completes.

        A source whose first messages do not cover a turn is watched for some of them, which count as sweeps until it
        is known that they are parts.
        """
        cloud = self._cloud(message)
        if cloud is None:
            return []
        if self._first is not None:
            self._watch(self._first, cloud, message.sent_s)
        if self._parts is not None:
            self.reception.joined += 1
            cloud = self._parts.add(cloud, message.sent_s)
            if cloud is None:
                return []
        stamp_s = cloud.stamp_s or message.sent_s
        return [
            Sweep(
                stamp_s,
                cloud.points,
                cloud.turn_s,
                frame_id=cloud.frame_id,
                mid_rad=cloud.mid_rad,
                delay_s=cloud.delay_s,
            )
        ]

    def _watch(self, first: list[tuple[PointCloud, float]], cloud: PointCloud, sent_s: float) -> None:
        """Add a message to the first ones, until it is known whether they are parts of turns."""
        first.append((cloud, sent_s))
        if len(first) <= WATCHED and TurnParts.may_be([one for one, _ in first]):
            return
        self._parts = TurnParts.of(first)
        self._first = None
        if self._parts is not None:
            log.warning("%s: %s", self._name, self._parts.note())

    def _cloud(self, message: Message) -> PointCloud | None:
        try:
            cloud = read_cloud(message.data)
            if cloud.frame_id != self.reception.frame_id and message.sent_s - self._seen_s < SILENT_S:
                raise MessageError("another_sensor", f"the topic has points in the frame {cloud.frame_id!r} too")
        except MessageError as error:
            if self.reception.refuse(error.reason):
                what = f"message refused ({error.reason}): {error}"
                log.warning("%s: %s; later ones are only counted", self._name, what)
            return None
        self._seen_s = message.sent_s
        if cloud.frame_id != self.reception.frame_id:
            self.reception.frame_id = cloud.frame_id
            foreign = cloud.frame_id.lstrip("/") in FOREIGN_FRAMES or cloud.frame_id.endswith(OPTICAL)
            remedy = ", not in the sensor's: subscribe to what its driver publishes" if foreign else ""
            level = logging.WARNING if foreign else logging.INFO
            log.log(level, "%s: points are in the frame %r%s", self._name, cloud.frame_id, remedy)
        return cloud


def open_ros2(address: Address, cores: frozenset[int] | None) -> LiveStream:
    """Open the sweeps of ros2:///TOPIC; Cyclone's threads and the receiving thread run on `cores`.

    Raises:
        MisuseError: Cyclone DDS is not installed, or the address names no topic, domain or reliability.
        ModtError: the domain cannot be joined.
    """
    topic = topic_of(address)
    reliable = address.choice("reliability", "best_effort", "reliable") == "reliable"
    with host.threads_on(cores):
        joined = participant(domain_of(address))
    subscription = Subscription(joined, topic, TYPE, depth=DEPTH, reliable=reliable)
    info = StreamInfo(f"/{topic}", "ros2")  # with the nominal period until the profile is known
    return LiveStream(info, PointCloudReader(subscription, info.name), cores=cores)
