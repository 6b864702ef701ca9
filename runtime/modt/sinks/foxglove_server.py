"""Results, energy and CPU time as channels of Foxglove, and the WebSocket server that it connects to."""

from __future__ import annotations

import logging
from typing import Any

import foxglove

from modt.address import Address
from modt.energy import ledger, windows
from modt.energy.attribution import usable
from modt.errors import MisuseError
from modt.ros2.cdr import CdrWriter
from modt.ros2.definitions import schema
from modt.sinks.messages import PREFIX, WORLD_FRAME_ID, topics
from modt.types import FrameResult

logging.getLogger("foxglove").setLevel(logging.ERROR)  # its warnings of each unwritten message are counted instead

BACKLOG = 16
"""Messages that may wait for a client; a slow client misses the oldest."""
PORT = 8765
NUMBER, TEXT = "std_msgs/Float64", "std_msgs/String"
FIGURES = {
    "energy/mJ_per_frame": NUMBER,
    "energy/watts": NUMBER,
    "energy/kind": TEXT,
    "cpu_ms/total": NUMBER,
    **{f"cpu_ms/{stage}": NUMBER for stage in ledger.STAGES},
}
"""Topics with one number or word each, and their types."""


class FoxgloveChannels:
    """The topics of `modt.sinks.messages`, and FIGURES below PREFIX, as ROS 2 messages.

    Messages have the stamps of the frames. They are encoded only while a client or file takes them.
    """

    def __init__(self, context: foxglove.Context, *, points: bool) -> None:
        def channel(name: str, kind: str) -> foxglove.Channel:
            package, _, short = kind.partition("/")
            form = foxglove.Schema(name=f"{package}/msg/{short}", encoding="ros2msg", data=schema(kind).encode())
            return foxglove.Channel(name, schema=form, message_encoding="cdr", context=context)

        made = topics(world_frame_id=WORLD_FRAME_ID, points=points)
        self._topics = [(channel(topic.name, topic.type), topic.encode) for topic in made]
        self._figures = {name: channel(f"/{PREFIX}/{name}", kind) for name, kind in FIGURES.items()}
        self._stamp_ns = 0

    def write(self, result: FrameResult) -> None:
        """Publish a frame."""
        self._stamp_ns = round(1e9 * result.frame.stamp_s)
        for channel, encode in self._topics:
            if channel.has_sinks():
                channel.log(encode(result), log_time=self._stamp_ns)

    def ledger(self, record: dict[str, Any]) -> None:
        """Publish the mean energy a frame of a window, or the CPU time of a frame's stages, at the last stamp."""
        for name, value in figures(record).items():
            cdr = CdrWriter()
            if isinstance(value, str):
                cdr.text(value)
            else:
                cdr.record(("d",), value)
            self._figures[name].log(cdr.message(), log_time=self._stamp_ns)


def figures(record: dict[str, Any]) -> dict[str, float | str]:
    """Values of the FIGURES that a line of the ledger contains."""
    if record["schema"] == windows.SCHEMA and usable(record) and record["frames"][2]:
        energy_J, n_frames = record["energy_J"], record["frames"][2]
        watts = energy_J / (1e-9 * record["wall_ns"]) if record["wall_ns"] else 0.0
        energy = {"mJ_per_frame": 1e3 * energy_J / n_frames, "watts": watts, "kind": record["kind"]}
        return {f"energy/{name}": value for name, value in energy.items()}
    if record["schema"] == ledger.SCHEMA:
        cpu_ns = {"total": record.get("cpu_ns", 0), **{s: row["cpu_ns"] for s, row in record["stages"].items()}}
        return {f"cpu_ms/{name}": 1e-6 * value for name, value in cpu_ns.items()}
    return {}


class FoxgloveServer(FoxgloveChannels):
    """Publishes to the connected clients. `port` is the one that is bound."""

    def __init__(self, host: str, port: int, *, points: bool) -> None:
        self._context = foxglove.Context()  # the server does not keep it alive
        super().__init__(self._context, points=points)
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
        points = address.choice("points", "all", "none") == "all"
        return FoxgloveServer(address.host or "127.0.0.1", port, points=points)
    except RuntimeError as error:
        remedy = "give a host of this machine and a free port"
        raise MisuseError(address.text, f"cannot be bound ({error})", remedy) from None
