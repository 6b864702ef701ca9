"""The lines of tracks.jsonl to a stream or a file, written in the background."""

from __future__ import annotations

import os
import sys
from pathlib import Path

from modt.address import Address
from modt.errors import MisuseError
from modt.sinks.background import Background
from modt.sinks.output import LineFile, writing
from modt.sinks.tracks import frame_line

DEPTH = 100
"""Number of lines that may wait for a stalled disk, 10 s at 10 Hz. No points wait: frames are encoded at once."""
LONGEST_LINE = 1 << 22
"""Longest incomplete line that is searched for at the end of a continued file [bytes]."""


class Descriptor:
    """Writes text to a file descriptor and never closes it."""

    def __init__(self, number: int) -> None:
        self._number = number

    def write(self, text: str, /) -> None:
        """Write the whole text; waits for the reader.

        Raises:
            OSError: the reader has left.
        """
        data = text.encode()
        while data:
            data = data[os.write(self._number, data) :]

    def close(self) -> None:
        """No effect."""


def open_stdout(address: Address) -> Background[str]:
    """Standard output."""
    return Background(address.text, Descriptor(sys.stdout.fileno()), DEPTH, encode=frame_line)


def open_file(address: Address) -> Background[str]:
    """A file, which is continued after its last whole line.

    Raises:
        MisuseError: no path, or not that of a file.
        ModtError: it cannot be written.
    """
    path = Path(address.path)
    if address.host or not address.path or (path.exists() and not path.is_file()):
        raise MisuseError(address.text, "names no file", "write file:///PATH")
    if path.exists():
        _end_with_a_line(path)
    return Background(address.text, LineFile[str](path, mode="ab"), DEPTH, encode=frame_line)


def _end_with_a_line(path: Path) -> None:
    """Cut off an incomplete last line, which a killed run leaves."""
    with writing(path), path.open("r+b") as file:
        begin = max(file.seek(0, os.SEEK_END) - LONGEST_LINE, 0)
        file.seek(begin)
        end = file.read()
        if not end.endswith(b"\n"):
            file.truncate(begin + end.rfind(b"\n") + 1)
