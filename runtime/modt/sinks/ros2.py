"""Topics of ROS 2: detections for programs, markers for the eye, the pose of the sensor."""

from __future__ import annotations

from collections.abc import Callable

from modt.address import Address
from modt.ros2.address import domain_of, name_of
from modt.ros2.dds import Publication, participant
from modt.sinks import ros2_detections, ros2_markers, ros2_transform
from modt.sinks.output import Health
from modt.types import FrameResult

PREFIX, FRAME_ID = "modt", "lidar"
"""Names where the address and, of the frame, the input state none."""
Topic = tuple[Publication, Callable[[FrameResult], bytes]]
"""Where messages go, and what makes them of a frame."""


class Ros2Sink:
    """Publishes each frame on its topics, where somebody has subscribed."""

    def __init__(self, topics: list[Topic]) -> None:
        self._unsent = 0
        self._topics = topics

    def write(self, result: FrameResult, /) -> None:
        """Publish a frame; never waits for a subscriber."""
        for publication, encode in self._topics:
            if publication.receivers:
                self._unsent += not publication.write(encode(result))

    def health(self) -> Health:
        """Messages that DDS did not take at once, because a reliable subscriber is behind."""
        return {"unsent": self._unsent}

    def close(self) -> None:
        """Leave the topics."""
        self._topics = []


def open_ros2(address: Address, cores: frozenset[int] | None = None) -> Ros2Sink:
    """The sink of ros2:///PREFIX?domain=N&frame_id=NAME&world_frame_id=NAME&tracks=objects|all.

    It publishes on PREFIX/detections and PREFIX/markers, in the frame of the input cloud. With a world_frame_id it
    publishes on /tf too; a robot whose tree of frames has the sensor's already gives none: a frame has one parent.

    Args:
        address: of the sink.
        cores: for Cyclone's threads, None: where the caller runs.

    Raises:
        MisuseError: Cyclone DDS is not installed, no number of a domain, or other tracks.
        ModtError: the domain cannot be joined.
    """
    prefix = name_of(address) or PREFIX
    background = address.choice("tracks", "objects", "all") == "all"
    joined = participant(domain_of(address), cores)
    named, world = address.option("frame_id"), address.option("world_frame_id")

    def topic(name: str, kind: str, encode: Callable[..., bytes], *more: object) -> Topic:
        publication = Publication(joined, name, kind)
        return publication, lambda result: encode(result, named or result.frame.frame_id or FRAME_ID, *more)

    topics = [
        topic(f"{prefix}/detections", ros2_detections.TYPE, ros2_detections.encode, background),
        topic(f"{prefix}/markers", ros2_markers.TYPE, ros2_markers.encode),
    ]
    if world:
        topics.append(topic(ros2_transform.TOPIC, ros2_transform.TYPE, ros2_transform.encode, world))
    return Ros2Sink(topics)
