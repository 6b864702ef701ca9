"""Results, energy and CPU time as channels of Foxglove: a WebSocket server, and MCAP recordings."""

from __future__ import annotations

import logging
import math
import re
import time
from collections.abc import Callable
from contextlib import suppress
from io import FileIO
from pathlib import Path
from typing import Any

import foxglove
from foxglove.mcap import MCAPCompression, MCAPWriteOptions

from modt.address import Address
from modt.energy.attribution import usable
from modt.energy.ledger import STAGES, LedgerLine
from modt.energy.windows import EnergyWindow
from modt.errors import MisuseError
from modt.ros2.cdr import CdrWriter
from modt.ros2.definitions import schema
from modt.sinks.output import writing
from modt.sinks.topics import PREFIX, WORLD_FRAME_ID, TopicOptions, topics
from modt.types import FrameResult

log = logging.getLogger(__name__)
logging.getLogger("foxglove").setLevel(logging.ERROR)  # its warnings of each unwritten message are counted instead

BACKLOG = 16
"""Messages that may wait for a client. A slow client misses the oldest."""
PORT = 8765
REFUSED = "foxglove.websocket.v1"
"""Protocol of viewers that the SDK's server refuses."""
NUMBER = "std_msgs/Float64"
TEXT = "std_msgs/String"
FIGURES = {
    "energy/mJ_per_frame": NUMBER,
    "energy/watts": NUMBER,
    "energy/kind": TEXT,
    "cpu_ms/total": NUMBER,
    **{f"cpu_ms/{stage}": NUMBER for stage in STAGES},
}
"""Topics with one number or word each, and their types."""


class FoxgloveChannels:
    """The topics of `modt.sinks.topics`, and FIGURES below PREFIX, as ROS 2 messages.

    Messages have the stamps of the frames. They are encoded only while a client or file takes them.
    """

    def __init__(self, context: foxglove.Context, options: TopicOptions) -> None:
        def channel(name: str, kind: str) -> foxglove.Channel:
            package, _, short = kind.partition("/")
            form = foxglove.Schema(name=f"{package}/msg/{short}", encoding="ros2msg", data=schema(kind).encode())
            return foxglove.Channel(name, schema=form, message_encoding="cdr", context=context)

        self._topics = [(channel(topic.name, topic.type), topic.encode) for topic in topics(options)]
        self._figures = {name: channel(f"/{PREFIX}/{name}", kind) for name, kind in FIGURES.items()}
        self._stamp_ns = 0

    def write(self, result: FrameResult) -> None:
        """Publish a frame."""
        self._stamp_ns = round(1e9 * result.frame.stamp_s)
        for channel, encode in self._topics:
            if channel.has_sinks():
                channel.log(encode(result), log_time=self._stamp_ns)

    def ledger(self, line: LedgerLine | EnergyWindow) -> None:
        """Publish the mean energy a frame of a window, or the CPU time of a frame's stages, at the last stamp."""
        for name, value in figures(line).items():
            cdr = CdrWriter()
            if isinstance(value, str):
                cdr.text(value)
            else:
                cdr.record(("d",), value)
            self._figures[name].log(cdr.message(), log_time=self._stamp_ns)


def figures(line: LedgerLine | EnergyWindow) -> dict[str, float | str]:
    """Values of the FIGURES that a line of the ledger contains."""
    if isinstance(line, LedgerLine):
        cpu_ms = {f"cpu_ms/{stage}": 1e-6 * work.cpu_ns for stage, work in line.stages.items()}
        return {"cpu_ms/total": 1e-6 * line.cpu_ns, **cpu_ms}
    if line.frame_J is None or line.watts is None or not usable(line):
        return {}
    return {
        "energy/mJ_per_frame": 1e3 * line.frame_J,
        "energy/watts": line.watts,
        "energy/kind": line.kind,
    }


class FoxgloveServer(FoxgloveChannels):
    """Publishes to the connected clients. `port` is the one that is bound."""

    def __init__(self, host: str, port: int, options: TopicOptions) -> None:
        self._context = foxglove.Context()  # the server does not keep it alive
        super().__init__(self._context, options)
        self._server = foxglove.start_server(
            name="modt", host=host, port=port, context=self._context, message_backlog_size=BACKLOG
        )
        self.port = self._server.port

    def close(self) -> None:
        """Disconnect all clients."""
        self._server.stop()


def open_foxglove(address: Address) -> FoxgloveServer:
    """A server, by default at 127.0.0.1, which no other machine reaches.

    Raises:
        MisuseError: the address cannot be bound.
    """
    try:
        port = PORT if address.port is None else address.port
        host = address.host or "127.0.0.1"
        opened = FoxgloveServer(host, port, _options(address))
    except RuntimeError as error:
        remedy = "give a host of this machine and a free port"
        raise MisuseError(address.text, f"cannot be bound ({error})", remedy) from None
    where = f"[{host}]" if ":" in host else host
    log.warning("Foxglove connects to ws://%s:%d (foxglove.sdk.v1; not the older %s)", where, opened.port, REFUSED)
    return opened


FLUSH_S = 1.0
"""Time between two flushes [s]. A crash loses no more than this."""
OPTIONS = MCAPWriteOptions(profile="ros2", compression=MCAPCompression.Lz4, compression_threads=0)
"""LZ4 costs less CPU time than writing uncompressed."""
PARTS = 8
"""Number of parts that share the size limit. The oldest is deleted for a new one."""


class _Output(FileIO):
    """The file of a part. It keeps the write error, which the SDK swallows."""

    def __init__(self, path: Path) -> None:
        with writing(path):
            super().__init__(path, "xb")
        self.path = path
        self.frames = 0
        self.error: OSError | None = None

    def write(self, data: Any) -> int:
        """Write, and return how much was written."""
        try:
            return super().write(data)
        except OSError as error:
            self.error = error
            raise


class McapRecorder:
    """Records at PATH, then at PATH with -1, -2 … before its suffix.

    After a write error the part ends, readable up to there, and the next frame begins another.

    Args:
        path: file of the first part.
        options: what is recorded.
        max_bytes: limit for all parts, including those of earlier runs. The oldest are deleted.
        clock: [s].

    Raises:
        ModtError: the file cannot be written.
    """

    def __init__(
        self,
        path: Path,
        options: TopicOptions,
        *,
        max_bytes: float = math.inf,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._path = path
        self._max_bytes = max_bytes
        self._clock = clock
        self._context = foxglove.Context()
        self._channels = FoxgloveChannels(self._context, options)
        self._output, self._writer = self._begin_part()
        self._flushed_s = clock()

    def write(self, result: FrameResult, /) -> None:
        """Record a frame.

        Raises:
            ModtError: the file cannot be written.
        """
        if self._output.error is not None or self._output.tell() > self._max_bytes / PARTS:
            self.close()
            self._output, self._writer = self._begin_part()
            self._flushed_s = self._clock()
        self._channels.write(result)
        if self._clock() - self._flushed_s >= FLUSH_S:
            self._flushed_s = self._clock()
            with suppress(RuntimeError):  # the output has kept the error
                self._writer.flush()
        with writing(self._output.path):
            if self._output.error is not None:
                raise self._output.error
        self._output.frames += 1

    def ledger(self, line: LedgerLine | EnergyWindow, /) -> None:
        """Record a line of the ledger. A failure is raised with the next frame."""
        self._channels.ledger(line)

    def close(self) -> None:
        """Write the index and close the part. A part that failed before its first frame is removed."""
        with suppress(RuntimeError):
            self._writer.close()
        self._output.close()
        if self._output.error is not None and not self._output.frames:
            self._output.path.unlink(missing_ok=True)

    def _begin_part(self) -> tuple[_Output, foxglove.MCAPWriter]:
        """Make room for another part, and open it under the next number."""
        earlier = self._earlier()
        self._make_room([path for _, path in earlier])
        number = earlier[-1][0] + 1 if earlier else 0
        name = f"{self._path.stem}-{number}{self._path.suffix}" if number else self._path.name
        output = _Output(self._path.with_name(name))
        writer = foxglove.open_mcap(output, context=self._context, writer_options=OPTIONS)
        return output, writer

    def _earlier(self) -> list[tuple[int, Path]]:
        """Numbers and files of the existing parts, the oldest first."""
        form = re.compile(rf"{re.escape(self._path.stem)}(?:-(\d+))?{re.escape(self._path.suffix)}")
        found = ((form.fullmatch(path.name), path) for path in self._path.parent.glob(f"*{self._path.suffix}"))
        return sorted((int(match[1] or 0), path) for match, path in found if match)

    def _make_room(self, parts: list[Path]) -> None:
        """Delete the oldest parts until another one fits."""
        with writing(self._path):
            excess = sum(path.lstat().st_size for path in parts) - self._max_bytes * (1 - 1 / PARTS)
            for path in parts:
                if excess > 0:
                    excess -= path.lstat().st_size
                    path.unlink()


def open_mcap(address: Address) -> McapRecorder:
    """A recording with the options of TopicOptions.of; `points=none` leaves the sweep out, `max_mb` limits it.

    Raises:
        MisuseError: no file name, or an invalid option.
        ModtError: the file cannot be written.
    """
    if address.host or not Path(address.path).name:
        raise MisuseError(address.text, "names no file", "write mcap:///PATH")
    try:
        max_bytes = 1e6 * float(address.option("max_mb", "inf"))
    except ValueError:
        max_bytes = 0.0
    if not max_bytes > 0:
        raise MisuseError(address.text, "max_mb is not a size", "write max_mb=MEGABYTES")
    return McapRecorder(Path(address.path), _options(address), max_bytes=max_bytes)


def _options(address: Address) -> TopicOptions:
    """Options of an address, by default with the sweep."""
    return TopicOptions.of(address, world_frame_id=WORLD_FRAME_ID, points=("all", "none"))
