from collections.abc import Iterator

from modt.sources.pose_source import PoseSource
from modt.sources.stream import Faults, Stream, StreamInfo
from modt.types import Frame, Self


class PosedStream:
    """A stream with the poses of a source."""

    def __init__(self, stream: Stream, odometry: PoseSource) -> None:
        self._stream, self.odometry = stream, odometry
        self.info: StreamInfo = odometry.of_stream(stream.info)
        self.faults: Faults = stream.faults

    def __iter__(self) -> Iterator[Frame]:
        """The frames with their poses."""
        return (self.odometry.place(frame) for frame in self._stream)

    def between(self, first: int, last: int | None) -> Self:
        """The frames with first <= index < last."""
        return type(self)(self._stream.between(first, last), self.odometry)
