"""Topics of ROS 2: detections for programs, markers for the eye."""

from __future__ import annotations

from modt.address import Address
from modt.ros2.address import domain_of, name_of
from modt.ros2.dds import Publication, participant
from modt.sinks import ros2_detections, ros2_markers
from modt.sinks.output import Health
from modt.types import FrameResult

PREFIX, FRAME_ID = "modt", "lidar"
"""Of an address that states none."""


class Ros2Sink:
    """Publishes each frame on PREFIX/detections and PREFIX/markers, where somebody has subscribed."""

    def __init__(self, detections: Publication, markers: Publication, frame_id: str) -> None:
        self._unsent = 0
        self._frame_id = frame_id
        self._topics = [(detections, ros2_detections.encode), (markers, ros2_markers.encode)]

    def write(self, result: FrameResult, /) -> None:
        """Publish a frame; never waits for a subscriber."""
        for publication, encode in self._topics:
            if publication.receivers:
                self._unsent += not publication.write(encode(result, self._frame_id))

    def health(self) -> Health:
        """Messages that DDS did not take at once, because a reliable subscriber is behind."""
        return {"unsent": self._unsent}

    def close(self) -> None:
        """Leave the topics."""
        self._topics = []


def open_sink(address: Address, cores: frozenset[int] | None = None) -> Ros2Sink:
    """The sink of ros2:///PREFIX?domain=N&frame_id=NAME; `cores` for Cyclone's threads, None: where the caller runs.

    Raises:
        MisuseError: Cyclone DDS is not installed, or no number of a domain.
        ModtError: the domain cannot be joined.
    """
    prefix = name_of(address) or PREFIX
    joined = participant(domain_of(address), cores)
    detections = Publication(joined, f"{prefix}/detections", ros2_detections.TYPE)
    markers = Publication(joined, f"{prefix}/markers", ros2_markers.TYPE)
    return Ros2Sink(detections, markers, address.option("frame_id", FRAME_ID))
