"""Poses received in datagrams, one each."""

from __future__ import annotations

import errno
import socket
import stat
import struct
import threading
from collections import deque
from contextlib import suppress
from pathlib import Path
from typing import Any

from modt.address import Address
from modt.config import OdometryConfig
from modt.errors import MisuseError
from modt.sources.pose_buffer import CAPACITY
from modt.sources.pose_datagram import MAX_BYTES, DatagramError, read_datagram
from modt.sources.received_poses import ReceivedPoses

_BUFFER_BYTES = 1 << 20
_READ_AT_ONCE = 4096  # in a flood; the kernel holds about as many
_EMPTIED_S = 0.01
_OVERFLOW = getattr(socket, "SO_RXQ_OVFL", 40)  # has Linux count what it dropped; Python does not name it
_COUNT = struct.Struct("=I")


class DatagramQueue:
    """The newest datagrams since they were last taken, oldest first.

    Of a Unix socket the kernel holds ten datagrams, whatever its buffer: where others can send to one, a thread
    empties it meanwhile.

    Args:
        bound: socket, which it owns.
        capacity: datagrams kept.
        max_bytes: of a datagram, beyond which it is cut.

    Attributes:
        overflowed: datagrams that the kernel dropped, where it says so.
    """

    def __init__(self, bound: socket.socket, capacity: int, max_bytes: int) -> None:
        bound.setblocking(False)
        self._socket, self._max_bytes = bound, max_bytes
        self._kept: deque[bytes] = deque(maxlen=capacity)
        self._crowded_out = self.overflowed = 0
        with suppress(OSError):
            bound.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, _BUFFER_BYTES)
        with suppress(OSError):
            bound.setsockopt(socket.SOL_SOCKET, _OVERFLOW, 1)
        self._address = bound.getsockname()
        self._lock, self._ended = threading.Lock(), threading.Event()
        self._thread = threading.Thread(target=self._keep_empty, name="poses", daemon=True)
        if bound.family == socket.AF_UNIX and self._address:
            self._thread.start()

    def take(self) -> tuple[list[bytes], int]:
        """The newest of what has arrived, and the number of older ones that they crowded out; without waiting."""
        with self._lock:
            self._read()
            taken, crowded_out = list(self._kept), self._crowded_out
            self._kept.clear()
            self._crowded_out = 0
        return taken, crowded_out

    def close(self) -> None:
        """Close the socket and remove its file."""
        self._ended.set()
        if self._thread.is_alive():
            self._thread.join()
        self._socket.close()
        if isinstance(self._address, str) and self._address:
            Path(self._address).unlink(missing_ok=True)

    def _keep_empty(self) -> None:
        while not self._ended.wait(_EMPTIED_S):
            with self._lock:
                self._read()

    def _read(self) -> None:
        for _ in range(_READ_AT_ONCE):
            try:
                raw, facts, _, _ = self._socket.recvmsg(self._max_bytes, socket.CMSG_SPACE(_COUNT.size))
            except OSError:  # nothing to read, or an error caused by the last sender
                return
            self._crowded_out += len(self._kept) == self._kept.maxlen
            self._kept.append(raw)
            for level, kind, value in facts:
                if (level, kind) == (socket.SOL_SOCKET, _OVERFLOW):
                    (self.overflowed,) = _COUNT.unpack(value[: _COUNT.size])


class PoseSocket(ReceivedPoses):
    """Reads the socket once a frame without blocking."""

    def __init__(self, bound: socket.socket, config: OdometryConfig, name: str) -> None:
        super().__init__(config, name)
        self._queue = DatagramQueue(bound, CAPACITY, MAX_BYTES + 1)

    def close(self) -> None:
        """Close the socket and remove its file."""
        self._queue.close()

    def _take(self) -> list[bytes]:
        """The newest CAPACITY datagrams: a flood must not delay the frame."""
        taken, crowded_out = self._queue.take()
        self.received, self.overflowed = self.received + len(taken) + crowded_out, self._queue.overflowed
        if crowded_out:
            self._refuse(DatagramError("crowded_out", f"more than {CAPACITY} a frame"), crowded_out)
        return taken

    _read = staticmethod(read_datagram)


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
