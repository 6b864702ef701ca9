"""A WebSocket server that Foxglove connects to."""

from __future__ import annotations

import foxglove

from modt.address import Address
from modt.errors import MisuseError
from modt.sinks.foxglove_channels import FoxgloveChannels

BACKLOG = 16
"""Messages that may wait for a client; a slow client misses the oldest."""
PORT = 8765


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
