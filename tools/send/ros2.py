"""Publish a stream as ROS 2 messages, PointCloud2 and Odometry, at the sensor's pace.

    python -m tools.send.ros2 DRIVE --domain 7 --loops 0 &
    modt run 'ros2:///points?domain=7' --odometry 'ros2:///odom?domain=7'

Stamps begin at the wall clock and advance as those of the stream, loop after loop. The poses are the sensor's.
CYCLONEDDS_URI chooses interfaces and sizes of fragments, as for any program that uses Cyclone DDS.
"""

from __future__ import annotations

import itertools
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

from modt.ros2 import odometry, point_cloud2
from modt.ros2.dds import Participant, Publication, participant
from modt.ros2.odometry import write_odometry
from modt.ros2.point_cloud2 import write_cloud
from modt.sources.recognise import open_stream
from modt.sources.stream import Stream
from modt.types import Frame
from tools.options import parser

WAIT_S = 60.0
"""Time to wait for the first receiver [s]."""
FRAME_ID = "lidar"
WORLD = "odom"


class Sender:
    """Publishes frames; the pose is sent before the points, so that it arrives first."""

    def __init__(self, joined: Participant, points: str = "points", poses: str = "odom") -> None:
        self.clouds = Publication(joined, points, point_cloud2.TYPE)
        self._poses = Publication(joined, poses, odometry.TYPE)

    def send(self, frame: Frame, stamp_s: float) -> int:
        """Publish a frame with a stamp [s]; return the size of the message of its points [bytes]."""
        if frame.T_world_sensor is not None:
            self._poses.write(write_odometry(stamp_s, WORLD, FRAME_ID, frame.T_world_sensor))
        message = write_cloud(stamp_s, FRAME_ID, frame.points)
        self.clouds.write(message)
        return len(message)

    def wait_for_receiver(self, timeout_s: float) -> bool:
        """Wait for a receiver of the points; False if there is none within the time."""
        deadline_s = time.monotonic() + timeout_s
        while not self.clouds.receivers and time.monotonic() < deadline_s:
            time.sleep(0.05)
        return self.clouds.receivers > 0


def looped(stream: Stream, loops: int) -> Iterator[tuple[float, Frame]]:
    """Frames of a stream, over and over (0: for ever), with the time of each since the first [s]."""
    began_s = 0.0
    for _ in range(loops) if loops else itertools.count():
        first_s = last_s = None
        for frame in stream:
            first_s = frame.stamp_s if first_s is None else first_s
            last_s = began_s + frame.stamp_s - first_s
            yield last_s, frame
        began_s = (began_s if last_s is None else last_s) + stream.info.period_s


def pace(due: Iterator[tuple[float, Frame]], send: Callable[[Frame, float], int], rate: float) -> tuple[int, int]:
    """Send each frame when it is due, at `rate` times the pace; frames and bytes sent."""
    frames = octets = 0
    epoch_s = time.time()
    began_s = time.monotonic()
    for after_s, frame in due:
        time.sleep(max(0.0, began_s + after_s / rate - time.monotonic()))
        octets += send(frame, epoch_s + after_s)
        frames += 1
    return frames, octets


def main() -> None:
    options = parser(__doc__)
    options.add_argument("path", type=Path, help="stream")
    options.add_argument("--domain", type=int, default=0)
    options.add_argument("--topic", default="points")
    options.add_argument("--odometry", default="odom", metavar="TOPIC")
    options.add_argument("--loops", type=int, default=1, help="0: for ever (default: %(default)s)")
    options.add_argument("--frames", type=int, help="of a loop, the first ones")
    options.add_argument("--rate", type=float, default=1.0, help="times the pace of the sensor")
    arguments = options.parse_args()
    stream = open_stream(arguments.path).between(0, arguments.frames)
    sender = Sender(participant(arguments.domain), arguments.topic, arguments.odometry)
    if not sender.wait_for_receiver(WAIT_S):
        sys.exit(f"/{arguments.topic}: no receiver within {WAIT_S:.0f} s")
    frames, octets = pace(looped(stream, arguments.loops), sender.send, arguments.rate)
    print(f"{frames} sweeps, {octets / 1e6:.1f} MB")


if __name__ == "__main__":
    main()
