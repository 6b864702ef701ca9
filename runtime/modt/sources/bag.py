"""Recordings of ROS 2: point clouds as frames, odometry or transforms as their poses."""

from __future__ import annotations

import copy
import heapq
import logging
from collections import Counter, deque
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from itertools import combinations, islice, pairwise
from pathlib import Path
from statistics import median
from types import MappingProxyType

from modt.errors import MisuseError, ModtError
from modt.ros2 import foxglove_cloud, livox_cloud, point_cloud2
from modt.ros2.cdr import CdrReader, MessageError
from modt.ros2.livox_cloud import read_livox_cloud
from modt.ros2.point_cloud2 import PointCloud
from modt.sources.bag_file import BagMessage, BagTopic
from modt.sources.bag_files import Bag
from modt.sources.bag_poses import PoseTopic, RecordedPoses, find_poses
from modt.sources.stamp_check import STEP_S, StampCheck
from modt.sources.stream import Faults, Reading, StreamInfo, Sweep, reason_of
from modt.sources.turn_parts import TurnParts
from modt.types import DESKEWED, NO_TURN, Frame, Self

log = logging.getLogger(__name__)

PEEKED = 50
"""Greatest number of messages that are searched for the first usable sweeps."""
COMPARED = 4
"""Number of first sweeps whose stamps are compared. The first stamp that fits a later one begins the stream."""
MAX_HELD = 20
"""Greatest number of frames that wait for their poses, which a localisation may give seconds later."""
STANDING_SHARE = 0.01
"""Stamps that pass by less than this share of the recorded times are no times in seconds, or stand still."""
MAX_PERIOD_S = 5.0
"""Stamps of sweeps that are farther apart are no times in seconds, if they were recorded nearer to each other [s]."""
HELD_PARTS = 2
"""Number of parts of turns that wait for an earlier one, which may be recorded after them."""
OPTIONS = frozenset({"topic", "odometry", "frame"})
"""Options of `open_bag`."""
ROS1 = "pip install rosbags; rosbags-convert --src FILE --dst FOLDER; give FOLDER"


class BagStream:
    """Frames of a recording; stamps count from its first usable sweep.

    A frame is held back until a pose at least as late is read, so that its pose is interpolated.
    Messages that are parts of a turn are joined. Unusable ones are counted and skipped, the first ones are logged.
    """

    def __init__(
        self,
        info: StreamInfo,
        bag: Bag,
        topic: str,
        began: tuple[float, float],
        poses: PoseTopic | None,
        parts: TurnParts | None = None,
        sensor: str | None = None,
        *,
        stamped: bool = True,
    ) -> None:
        """Read a topic.

        Args:
            info: properties of the stream.
            bag: the recording.
            topic: topic of point clouds.
            began: stamp and recorded time of the first sweep whose stamp is accepted [s].
            poses: topic of poses.
            parts: joins messages that are parts of a turn; None where a message is a sweep.
            sensor: frame of the points that are read where several sensors share the topic; None for one sensor.
            stamped: whether the stamps of the sweeps are their times; otherwise these are the recorded ones.
        """
        self.info = info
        self.faults = Faults()
        self.reading = Reading()
        self._bag = bag
        self._topic = topic
        self._encoding = bag.topics()[topic].encoding
        self._reader = _reader(bag.topics()[topic]) or point_cloud2.read_cloud
        self._began = began
        self._poses = poses
        self._parts = parts
        self._sensor = sensor
        self._stamped = stamped
        self._first = 0
        self._last: int | None = None

    def __iter__(self) -> Iterator[Frame]:
        """Yield the frames, with poses where there are any.

        Raises:
            ModtError: none can be used.
        """
        poses = RecordedPoses(self._poses, self._began)
        self.reading = Reading(poses=str(self._poses or ""))
        used = 0
        for frame in self._held(poses):
            used += 1
            placed = poses.place(frame)
            if frame.delay_s is not None and placed.delay_s is None:
                self.reading.times[NO_TURN] -= 1
                self.reading.times[DESKEWED] += 1
            self.reading.without_pose += bool(poses.topics) and placed.T_world_sensor is None
            yield placed
        if poses.lost:
            self.faults.leave_out(self.reading.messages, self._poses, "messages of poses cannot be read", poses.lost)
        if not used and self.reading.messages:
            first = f" ({self.faults.first[0].cause})" if self.faults.first else ""
            cause = f"none of its {self.reading.messages} messages of {self._topic} can be used{first}"
            raise ModtError(
                self.info.name, cause, "have the driver write x, y, z [m] as float32 in the sensor's frame"
            )

    def _held(self, poses: RecordedPoses) -> Iterator[Frame]:
        """Frames, each once a pose at least as late is read, or after MAX_HELD later frames."""
        held: deque[Frame] = deque()
        for frame in self._frames(poses, StampCheck(self._began)):
            if frame is not None:
                held.append(frame)
            while held and (poses.newest_s >= held[0].stamp_s or len(held) > MAX_HELD):
                yield held.popleft()
        yield from held

    def between(self, first: int, last: int | None) -> Self:
        """Frames with first <= index < last; others are not decoded, unless they come in parts."""
        part = copy.copy(self)
        part.faults = Faults()
        part._first = max(first, self._first)
        ends = [end for end in (last, self._last) if end is not None]
        part._last = min(ends, default=None)
        if self.info.n_frames is not None:
            end = min([*ends, self.info.end or 0])
            part.info = replace(self.info, n_frames=max(end - part._first, 0), end=end)
        return part

    def _frames(self, poses: RecordedPoses, stamps: StampCheck) -> Iterator[Frame | None]:
        """Frames in their order; None after a message of a pose, or one without a frame."""
        if self._parts is None:
            return self._whole_sweeps(poses, stamps)
        return self._joined_parts(copy.deepcopy(self._parts), poses, stamps)

    def _whole_sweeps(self, poses: RecordedPoses, stamps: StampCheck) -> Iterator[Frame | None]:
        """Frames of messages that are whole sweeps."""
        index = -1
        for message in self._messages(poses):
            if message is None:
                yield None
                continue
            index += 1
            if self._last is not None and index >= self._last:
                return
            if index < self._first:
                self._pass_over(message, stamps)
                continue
            cloud = self._cloud(index, message)
            yield None if cloud is None else self._frame(index, cloud, message, stamps)
        self._account_for_damage()

    def _joined_parts(self, parts: TurnParts, poses: RecordedPoses, stamps: StampCheck) -> Iterator[Frame | None]:
        """Frames of messages that are parts of a sweep."""
        last: BagMessage | None = None
        index = -1
        for found in self._parts_in_order(poses, abs(parts.turn_s)):
            if found is None:
                yield None
                continue
            part, message = found
            last = message
            cloud = parts.add(part, message.recorded_s)
            index += cloud is not None
            if self._last is not None and index >= self._last:
                return
            yield None if cloud is None or index < self._first else self._frame(index, cloud, message, stamps)
        if last is not None and (cloud := parts.finish()) is not None:
            yield self._frame(index + 1, cloud, last, stamps)
        if parts.late:
            reason = "parts of turns came after their turn"
            self.faults.leave_out(self.reading.messages, self._topic, reason, parts.late)
        self._account_for_damage()

    def _parts_in_order(self, poses: RecordedPoses, turn_s: float) -> Iterator[tuple[PointCloud, BagMessage] | None]:
        """Parts of turns by their times, unless a clock was set back; None after a message without one."""
        waiting: list[tuple[float, int, PointCloud, BagMessage]] = []
        for number, message in enumerate(self._messages(poses)):
            part = None if message is None else self._cloud(number, message)
            if message is None or part is None:
                yield None
                continue
            time_s = part.began_s or message.recorded_s
            clock_set = bool(waiting) and time_s < waiting[0][0] - turn_s
            while waiting and (clock_set or len(waiting) > HELD_PARTS):
                yield heapq.heappop(waiting)[2:]
            heapq.heappush(waiting, (time_s, number, part, message))
        while waiting:
            yield heapq.heappop(waiting)[2:]

    def _messages(self, poses: RecordedPoses) -> Iterator[BagMessage | None]:
        """Messages of the sensor; None after one of a pose. Those of other sensors in the topic are counted."""
        others = Counter[str]()  # by their frames
        for message in self._bag.messages({self._topic} | poses.topics):
            if message.topic != self._topic:
                poses.add(message)
                yield None
            elif (other := self._other_sensor(message)) is not None:
                others[other] += 1
            else:
                yield message
        for other, number in others.items():
            reason = f"messages are of another sensor, in the frame {other}"
            self.faults.leave_out(self.reading.messages, self._topic, reason, number)

    def _other_sensor(self, message: BagMessage) -> str | None:
        """Frame of a message of another sensor; None for those that are read."""
        if self._sensor is None or message.flaw:
            return None
        try:
            frame_id = self._reader(message.data).frame_id
        except MessageError:
            return None
        return None if frame_id == self._sensor else frame_id

    def _stamp_s(self, cloud: PointCloud, message: BagMessage) -> float:
        return (cloud.stamp_s if self._stamped else 0.0) or message.recorded_s

    def _account_for_damage(self) -> None:
        """Count what the recording promises and does not hold, once it is read to its end."""
        for flaw in self._bag.flaws:
            self.faults.leave_out(self.reading.messages, self.info.name, flaw)
        for topic, number in self._bag.missing.items():
            self.faults.leave_out(self.reading.messages, self.info.name, f"messages of {topic} are missing", number)

    def _cloud(self, index: int, message: BagMessage) -> PointCloud | None:
        """The points of a message; None if it cannot be read."""
        self.reading.messages += 1
        try:
            if message.flaw:
                raise MessageError("damaged", message.flaw)
            cloud = self._reader(message.data)
        except MessageError as error:
            self.faults.report(max(index, 0), self._topic, str(error), skipped=True)
            return None
        self.reading.frame_id = cloud.frame_id
        if cloud.corrected:
            if not self.reading.corrected:
                log.warning("%s: %s; read as it makes sense", self._topic, cloud.corrected)
            self.reading.corrected[reason_of(cloud.corrected)] += 1
        self.reading.joined += self._parts is not None
        return cloud

    def _frame(self, index: int, cloud: PointCloud, message: BagMessage, stamps: StampCheck) -> Frame | None:
        self.reading.sweeps += 1
        self.reading.times[cloud.times] += 1
        stamp_s = self._stamp_s(cloud, message)
        sweep = Sweep(stamp_s, cloud.points, cloud.turn_s, mid_rad=cloud.mid_rad, delay_s=cloud.delay_s)
        return stamps.frame(sweep, message.recorded_s, index, self._topic, self.faults, began_s=self._began[0])

    def _pass_over(self, message: BagMessage, stamps: StampCheck) -> None:
        """Follow the stamp of a sweep before the first one asked for."""
        stamp_s = message.recorded_s
        if self._stamped and self._encoding == "cdr" and not message.flaw:
            try:
                stamp_s = CdrReader(message.data).stamp_s() or stamp_s
            except MessageError:
                return
        stamps.doubt(stamp_s, message.recorded_s)


def open_bag(path: Path, period_s: float, options: Mapping[str, str] = MappingProxyType({})) -> BagStream:
    """Stream of a rosbag2 folder, a .db3 or an .mcap file; `period_s` holds for a recording of a single sweep.

    The options are `topic`, of point clouds, `frame`, of the sensor where several share the topic, and `odometry`,
    a topic of odometry or of transforms.

    Raises:
        MisuseError: no topic of point clouds, several and none is chosen, or no library to read the file.
        ModtError: the file cannot be read.
    """
    path = path.resolve()
    bag = Bag(path)
    topics = bag.topics()
    chosen = _choose(path, topics, options.get("topic"))
    began = _first_clouds(path, bag, chosen)
    sensors = [*dict.fromkeys(cloud.frame_id for cloud, _ in began)]
    sensor = _sensor(path, sensors, options.get("frame"))
    began = [(cloud, message) for cloud, message in began if cloud.frame_id == sensor]
    stamped = _pass(began)
    stamps = [((c.stamp_s if stamped else 0.0) or m.recorded_s, m.recorded_s) for c, m in began[:COMPARED]]
    first = next((a for a, b in combinations(stamps, 2) if not StampCheck(a).doubt(*b)), stamps[0])
    steps_s = (b[0] - a[0] for a, b in pairwise(stamps) if b[0] > a[0] and not StampCheck(a).doubt(*b))
    poses, notes = find_poses(bag, sensor, options.get("odometry"))
    parts = TurnParts.of([(cloud, message.recorded_s) for cloud, message in began])
    known = parts is None and len(sensors) == 1  # how many sweeps there are
    count = topics[chosen].count if known else None
    info = StreamInfo(
        name=path.stem if path.is_file() else path.name,
        layout="rosbag2",
        n_frames=count,
        period_s=next(steps_s, period_s) if parts is None else round(abs(parts.turn_s), 3),
        has_poses=poses is not None,
        notes=(*_notes(sensors, sensor, stamped=stamped), *(() if parts is None else (parts.note(),))),
        pose_notes=notes,
        end=count,
        began_s=first[0],
    )
    return BagStream(info, bag, chosen, first, poses, parts, sensor if len(sensors) > 1 else None, stamped=stamped)


def _pass(clouds: list[tuple[PointCloud, BagMessage]]) -> bool:
    """Whether the stamps of the first sweeps pass as their recorded times do, or as in a conversion, faster."""
    stamps = [cloud.stamp_s for cloud, _ in clouds]
    steps_s = (b.recorded_s - a.recorded_s for (_, a), (_, b) in pairwise(clouds))
    recorded_s = sum(step_s for step_s in steps_s if 0 < step_s < STEP_S)  # but for clocks that were set
    if len(clouds) < COMPARED or not recorded_s:
        return True
    stand = max(stamps) - min(stamps) < STANDING_SHARE * recorded_s
    leap = median(abs(b - a) for a, b in pairwise(stamps)) > MAX_PERIOD_S > recorded_s / len(stamps)
    return not stand and not leap


def _sensor(path: Path, sensors: list[str], asked: str | None) -> str:
    """Frame of the sensor that is read.

    Raises:
        MisuseError: none of the sensors has the frame that is asked for.
    """
    if asked is not None and asked not in sensors:
        raise MisuseError(path, f"no points in the frame {asked}", f"frames of points: {', '.join(sensors)}")
    return sensors[0] if asked is None else asked


def _notes(sensors: list[str], sensor: str, *, stamped: bool) -> Iterator[str]:
    """Lines about the frames and the stamps of the points."""
    yield from _frame_note(sensor)
    if others := ", ".join(other for other in sensors if other != sensor):
        yield f"several sensors share the topic: {sensor} is read; --capture frame=NAME chooses among it and {others}"
    if not stamped:
        yield "the stamps of the sweeps stand still, or are no seconds: their times are those of the recording"


def _frame_note(frame_id: str) -> tuple[str, ...]:
    """A line about points that are not in the frame of a sensor."""
    if frame_id.endswith(point_cloud2.OPTICAL):
        return (f"points are in {frame_id!r}, with the axes of a camera: modt takes x as forward and z as up",)
    if frame_id.rpartition("/")[2] not in point_cloud2.FOREIGN_FRAMES:
        return ()
    return (f"points are in the frame {frame_id!r}, not in the sensor's: record what its driver publishes",)


def _choose(path: Path, topics: dict[str, BagTopic], asked: str | None) -> str:
    clouds = sorted(name for name, topic in topics.items() if topic.count and _reader(topic))
    if asked is not None:
        asked = "/" + asked.strip("/")
        if asked not in clouds:
            there = ", ".join(clouds) or "none"
            raise MisuseError(path, f"no point clouds in {asked}", f"topics of sensor_msgs/PointCloud2: {there}")
        return asked
    if not clouds:
        kinds = {(topic.type, topic.encoding) for topic in topics.values() if topic.count}
        there = ", ".join(sorted(k if e == "cdr" else f"{k} in {e}" for k, e in kinds)) or "nothing"
        old = any(e == "ros1" for _, e in kinds)
        remedy = f"convert it from ROS 1: {ROS1}" if old else "record the driver's point clouds"
        raise MisuseError(path, "no sensor_msgs/PointCloud2", f"{remedy}; it holds {there}")
    if len(clouds) > 1:
        raise MisuseError(
            path, f"{len(clouds)} topics of point clouds", f"choose by --capture topic=NAME: {', '.join(clouds)}"
        )
    return clouds[0]


CDR_READERS = {point_cloud2.TYPE: point_cloud2.read_cloud} | dict.fromkeys(livox_cloud.TYPES, read_livox_cloud)
"""Readers of messages in CDR by their types."""


def _reader(topic: BagTopic) -> Callable[[bytes], PointCloud] | None:
    """Reader of the messages of a topic; None if they are no point clouds."""
    if topic.encoding == "cdr":
        return CDR_READERS.get(topic.type)
    return foxglove_cloud.READERS.get(topic.encoding) if topic.type == foxglove_cloud.TYPE else None


def _first_clouds(path: Path, bag: Bag, topic: str) -> list[tuple[PointCloud, BagMessage]]:
    """First usable messages, at least one, and enough to tell whether they are parts of a turn.

    Raises:
        ModtError: no message can be used.
    """
    clouds: list[tuple[PointCloud, BagMessage]] = []
    refused = "no message"
    read = _reader(bag.topics()[topic]) or point_cloud2.read_cloud
    for message in islice(bag.messages({topic}), PEEKED):
        try:
            if message.flaw:
                raise MessageError("damaged", message.flaw)
            clouds.append((read(message.data), message))
        except MessageError as error:
            refused = str(error)
        if len(clouds) >= COMPARED and not TurnParts.may_be([cloud for cloud, _ in clouds]):
            break
    if not clouds:
        remedy = "record sensor_msgs/PointCloud2 in CDR, with x, y, z [m] as float32"
        raise ModtError(path, f"no usable sweep at the begin of {topic} ({refused})", remedy)
    return clouds
