"""Text files, read whatever their bytes are."""

from __future__ import annotations

from pathlib import Path

from modt.errors import MisuseError, refuse_pipe


def read_lines(path: Path, remedy: str) -> list[str]:
    """Lines of a text file; MisuseError as `read_text`."""
    return read_text(path, remedy).splitlines()


def read_text(path: Path, remedy: str) -> str:
    """Text of a file; bytes that are no UTF-8 are replaced.

    Raises:
        MisuseError: the file cannot be read, or is a pipe or device, which may never end.
    """
    refuse_pipe(path, remedy)
    try:
        return path.read_text(encoding="utf-8-sig", errors="replace")
    except OSError as error:
        raise MisuseError(path, f"cannot be read ({error.strerror})", remedy) from None
