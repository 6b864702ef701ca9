"""Poses received in datagrams, one each."""

from __future__ import annotations

import errno
import socket
import stat
from pathlib import Path
from typing import Any

from modt.address import Address
from modt.config import OdometryConfig
from modt.errors import MisuseError
from modt.sources.datagram_queue import DatagramQueue
from modt.sources.pose_datagram import MAX_BYTES, DatagramError, read_datagram
from modt.sources.received_poses import ReceivedPoses


class PoseSocket(ReceivedPoses):
    """Reads the socket once a frame without blocking."""

    def __init__(self, bound: socket.socket, config: OdometryConfig, name: str) -> None:
        super().__init__(config, name)
        self._queue = DatagramQueue(bound, config.capacity, MAX_BYTES + 1)

    def close(self) -> None:
        """Close the socket and remove its file."""
        self._queue.close()

    def _drain(self, now_s: float) -> None:
        """Read what has arrived, the newest `capacity` datagrams: a flood must not delay the frame."""
        taken, crowded_out = self._queue.take()
        self.received, self.overflowed = self.received + len(taken) + crowded_out, self._queue.overflowed
        if crowded_out:
            self._refuse(DatagramError("crowded_out", f"more than {self.config.capacity} a frame"), crowded_out)
        for raw in taken:
            try:
                self._keep(*read_datagram(raw), now_s)
            except DatagramError as error:
                self._refuse(error)


def open_socket(address: Address) -> socket.socket:
    """A socket bound to udp://HOST:PORT or unix:///PATH.

    Raises:
        MisuseError: the address names no socket, or it cannot be bound.
    """
    host, port, path = address.host, address.port, address.path
    try:
        if address.scheme == "udp" and host and port and path in ("", "/"):
            family, _, _, _, bound = socket.getaddrinfo(host, port, type=socket.SOCK_DGRAM)[0]
            return _bound(family, bound)
        if address.scheme == "unix" and not host and len(path) > 1:
            if _stale(path):
                Path(path).unlink()
            return _bound(socket.AF_UNIX, path)
    except OSError as error:
        remedy = "give a free port of this machine, or a free path in a writable folder"
        raise MisuseError(address.text, f"cannot be bound ({error.strerror or error})", remedy) from None
    raise MisuseError(address.text, "names no socket", "write udp://HOST:PORT or unix:///PATH")


def _bound(family: int, address: Any) -> socket.socket:
    made = socket.socket(family, socket.SOCK_DGRAM)
    try:
        made.bind(address)
    except OSError:
        made.close()
        raise
    return made


def _stale(path: str) -> bool:
    """Whether the path is a socket without a listener, left by an aborted run."""
    if not Path(path).exists() or not stat.S_ISSOCK(Path(path).stat().st_mode):
        return False
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as probe:
        return probe.connect_ex(path) == errno.ECONNREFUSED
