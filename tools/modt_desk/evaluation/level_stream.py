"""The stream of a run whose sensor is tilted, turned level as the run saw it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

from modt.placement import Mount
from modt.sources.stream import Faults, Stream, StreamInfo
from modt.types import Frame, Self


def recorded_mount(facts: dict[str, Any]) -> Mount:
    """The mount of the sensor of a run, by the content of its run.yaml."""
    sensor = facts.get("profile", {}).get("sensor", {})
    return Mount.of(sensor.get("roll_deg"), sensor.get("pitch_deg"))


class LevelStream:
    """The frames of a stream, and its camera, for level points."""

    def __init__(self, stream: Stream, mount: Mount) -> None:
        self._stream, self._mount = stream, mount
        camera = stream.info.camera
        self.info: StreamInfo = replace(stream.info, camera=camera and mount.camera(camera))
        self.faults: Faults = stream.faults

    def __iter__(self) -> Iterator[Frame]:
        """The frames."""
        return map(self._mount.level, self._stream)

    def between(self, first: int, last: int | None) -> Self:
        """The frames with first <= index < last."""
        return type(self)(self._stream.between(first, last), self._mount)
