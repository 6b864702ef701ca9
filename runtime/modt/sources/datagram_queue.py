"""Datagrams of a socket, the newest of them."""

from __future__ import annotations

import socket
import struct
import threading
from collections import deque
from contextlib import suppress
from pathlib import Path

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
