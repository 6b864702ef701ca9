"""Results on topics of ROS 2."""

from __future__ import annotations

from modt.address import Address
from modt.ros2.address import domain_of, name_of
from modt.ros2.dds import Publication, participant
from modt.sinks.output import Health
from modt.sinks.topics import PREFIX, Topic, TopicOptions, topics
from modt.types import FrameResult


class Ros2Sink:
    """Publishes each frame on the topics that have subscribers."""

    def __init__(self, topics: list[tuple[Topic, Publication]]) -> None:
        self._unsent = 0
        self.topics = topics

    def write(self, result: FrameResult, /) -> None:
        """Publish a frame without waiting for a subscriber."""
        for topic, publication in self.topics:
            if publication.receivers:
                self._unsent += not publication.write(topic.encode(result))

    def health(self) -> Health:
        """Number of messages that DDS refused because a reliable subscriber is slow."""
        return {"unsent": self._unsent}

    def close(self) -> None:
        """Leave the topics."""
        self.topics = []


def open_ros2(address: Address) -> Ros2Sink:
    """The sink of ros2:///PREFIX?domain=N and the options of TopicOptions.of.

    Raises:
        MisuseError: Cyclone DDS is not installed, or an option is invalid.
        ModtError: the domain cannot be joined.
    """
    made = topics(TopicOptions.of(address, prefix=name_of(address) or PREFIX))
    joined = participant(domain_of(address))
    return Ros2Sink([(topic, Publication(joined, topic.name, topic.type)) for topic in made])
