"""The lines of tracks.jsonl to a stream or a file, written in the background."""

from __future__ import annotations

import os
import sys
from pathlib import Path

from modt.address import Address
from modt.errors import MisuseError
from modt.sinks.background import Background
from modt.sinks.output import Health, LineFile, writing
from modt.sinks.tracks import frame_line
from modt.types import FrameResult

DEPTH = 100
"""Lines that may wait: 10 s of a disk that stalls."""
LONGEST_LINE = 1 << 22
"""Of a file that is continued [bytes]."""


class FrameLines:
    """Encodes the line of a frame and hands it on: what waits holds no points."""

    def __init__(self, lines: Background[str]) -> None:
        self._lines = lines

    def write(self, result: FrameResult, /) -> None:
        """Hand over the line of a frame.

        Raises:
            ValueError: a number is not finite.
        """
        self._lines.write(frame_line(result))

    def close(self) -> None:
        """Close the lines."""
        self._lines.close()

    def health(self) -> Health:
        """Of the lines."""
        return self._lines.health()


class Descriptor:
    """Writes text to a file descriptor that is not its own."""

    def __init__(self, number: int) -> None:
        self._number = number

    def write(self, text: str, /) -> None:
        """Write all of it; waits for the reader.

        Raises:
            OSError: nobody reads any more.
        """
        data = text.encode()
        while data:
            data = data[os.write(self._number, data) :]

    def close(self) -> None:
        """No effect."""


def open_stdout(address: Address) -> FrameLines:
    """Standard output."""
    return FrameLines(Background(address.text, Descriptor(sys.stdout.fileno()), DEPTH))


def open_file(address: Address) -> FrameLines:
    """A file, which is continued after its last whole line.

    Raises:
        MisuseError: the path is none, or not that of a file.
        ModtError: it cannot be written.
    """
    path = Path(address.path)
    if address.host or not address.path or (path.exists() and not path.is_file()):
        raise MisuseError(address.text, "names no file", "write file:///PATH")
    if path.exists():
        _end_with_a_line(path)
    return FrameLines(Background(address.text, LineFile[str](path, mode="ab"), DEPTH))


def _end_with_a_line(path: Path) -> None:
    """Cut off what a run that was killed left of its last line."""
    with writing(path), path.open("r+b") as file:
        begin = max(file.seek(0, os.SEEK_END) - LONGEST_LINE, 0)
        file.seek(begin)
        end = file.read()
        if not end.endswith(b"\n"):
            file.truncate(begin + end.rfind(b"\n") + 1)
