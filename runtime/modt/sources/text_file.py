"""Text files of lines or of numbers."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from modt.errors import MisuseError, refuse_pipe
from modt.types import Float64


def read_lines(path: Path, remedy: str) -> list[str]:
    """Lines of a text file, as of `read_text`."""
    return read_text(path, remedy).splitlines()


def read_text(path: Path, remedy: str) -> str:
    """A file as text, with replacements for what is none.

    Raises:
        MisuseError: it cannot be read, or is a pipe or device, which may never end.
    """
    refuse_pipe(path, remedy)
    try:
        return path.read_text(encoding="utf-8-sig", errors="replace")
    except OSError as error:
        raise MisuseError(path, f"cannot be read ({error.strerror})", remedy) from None


def read_numbers(path: Path, remedy: str) -> Float64:
    """(n, k) numbers of a file of n lines.

    Raises:
        MisuseError: it cannot be read, or is no table of numbers.
    """
    rows = [line.split() for line in read_lines(path, remedy)]
    try:
        return np.array(rows, dtype=np.float64).reshape(len(rows), -1)
    except ValueError:
        raise MisuseError(path, "is no table of numbers", remedy) from None
