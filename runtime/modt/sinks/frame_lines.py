"""The lines of tracks.jsonl to a stream or a file, in the background, or as datagrams, sent without waiting."""

from __future__ import annotations

import errno
import logging
import os
import socket
import sys
from pathlib import Path
from typing import Any

from modt.address import Address
from modt.errors import MisuseError
from modt.sinks.background import Background
from modt.sinks.output import Health, LineFile, Writer, without_links, writing
from modt.sinks.tracks import frame_line, frame_parts
from modt.types import FrameResult

log = logging.getLogger(__name__)

DEPTH = 100
"""Number of lines that may wait for a stalled disk, 10 s at 10 Hz. Frames are encoded first, so no points wait."""
LONGEST_LINE = 1 << 22
"""Longest incomplete line that is searched for at the end of a continued file [bytes]."""


class Descriptor(Writer[str]):
    """Writes text to a file descriptor and never closes it."""

    def __init__(self, number: int) -> None:
        self._number = number

    def write(self, text: str, /) -> None:
        """Write the whole text, and wait for the reader.

        Raises:
            OSError: the reader has left.
        """
        data = text.encode()
        while data:
            data = data[os.write(self._number, data) :]


def open_stdout(address: Address) -> Background[str]:
    """Standard output."""
    return Background(address.text, Descriptor(sys.stdout.fileno()), DEPTH, encode=frame_line)


class RotatedFile(LineFile[str]):
    """A file of lines that begins anew under its path when it has been renamed or removed, as by logrotate."""

    def write(self, text: str, /) -> None:
        """Append lines to the file that the path leads to."""
        if not self.present():
            self.renew()
        super().write(text)


def open_file(address: Address) -> Background[str]:
    """A file, which is continued after its last whole line.

    Raises:
        MisuseError: no path, or not that of a file, or that of a link.
        ModtError: it cannot be written.
    """
    path = Path(address.path)
    if address.host or not address.path or (path.exists() and not path.is_file()):
        raise MisuseError(address.text, "names no file", "write file:///PATH")
    if path.is_symlink():
        raise MisuseError(address.text, "is a symbolic link, which is not followed", "give the file that it leads to")
    if path.exists():
        _end_with_a_line(path)
    return Background(address.text, RotatedFile(path, mode="ab"), DEPTH, encode=frame_line)


def _end_with_a_line(path: Path) -> None:
    """Cut off an incomplete last line, which a killed run leaves."""
    with writing(path), open(path, "r+b", opener=without_links) as file:
        begin = max(file.seek(0, os.SEEK_END) - LONGEST_LINE, 0)
        file.seek(begin)
        end = file.read()
        if not end.endswith(b"\n"):
            file.truncate(begin + end.rfind(b"\n") + 1)


MAX_BYTES = 65_507
"""Longest datagram over UDP [bytes]. Longer lines are sent in parts."""
MAX_PATH_BYTES = 107
"""Longest path of a Unix socket [bytes]."""
SEND_BYTES = 1 << 20
"""Requested buffer for datagrams that the receiver has not read yet [bytes]."""
_FULL = (errno.EAGAIN, errno.ENOBUFS)


class Datagrams:
    """One datagram a frame. An absent or slow receiver misses frames and delays nothing."""

    def __init__(self, name: str, family: int, target: Any) -> None:
        self._name = name
        self._target = target
        self._socket = socket.socket(family, socket.SOCK_DGRAM)
        self._socket.setblocking(False)
        self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, SEND_BYTES)
        self._written = 0
        self._dropped = 0
        self._failed = 0
        self._state = "ok"

    def write(self, result: FrameResult, /) -> None:
        """Send the line of a frame, or its parts. If a part cannot be sent, the rest of the frame is dropped.

        Raises:
            ValueError: a number is not finite.
        """
        try:
            for part in frame_parts(result, MAX_BYTES):
                self._socket.sendto(part.encode(), self._target)
        except OSError as error:
            self._miss(error)
        else:
            self._written += 1
            self._state = "ok"

    def close(self) -> None:
        """Close the socket."""
        self._socket.close()

    def health(self) -> Health:
        """Frames sent, dropped at a full queue of the receiver, failed without a receiver, and the last failure."""
        return {"written": self._written, "dropped": self._dropped, "failed": self._failed, "state": self._state}

    def _miss(self, error: OSError) -> None:
        """Count a frame that was not sent, and log the first in a row."""
        cause = str(error.strerror or error)
        full = error.errno in _FULL
        self._dropped += full
        self._failed += not full
        if self._state == "ok":
            who = "its receiver is behind" if full else "nobody receives"
            log.warning("%s: %s (%s); frames are lost and counted until it reads again", self._name, who, cause)
        self._state = cause


def open_udp(address: Address) -> Datagrams:
    """A UDP receiver.

    Raises:
        MisuseError: no host or port, or an unknown host.
    """
    if not address.host or not address.port or address.path.strip("/"):
        raise MisuseError(address.text, "names no receiver", "write udp://HOST:PORT")
    try:
        family, _, _, _, target = socket.getaddrinfo(address.host, address.port, type=socket.SOCK_DGRAM)[0]
    except OSError as error:
        raise MisuseError(address.text, f"unknown host ({error.strerror})", "give a host that is reachable") from None
    return Datagrams(address.text, family, target)


def open_unix(address: Address) -> Datagrams:
    """A receiver that binds a datagram socket to a path, now or later.

    Raises:
        MisuseError: no path, or one that is too long.
    """
    if address.host or not 1 < len(os.fsencode(address.path)) <= MAX_PATH_BYTES:
        raise MisuseError(address.text, "names no socket", f"write unix:///PATH, of {MAX_PATH_BYTES} bytes at most")
    return Datagrams(address.text, socket.AF_UNIX, address.path)
