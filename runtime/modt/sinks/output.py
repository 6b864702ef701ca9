"""Output files: unbuffered writes, and failures as errors with a remedy."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import BinaryIO

from modt.errors import ModtError


@contextmanager
def writing(path: Path) -> Iterator[None]:
    """Convert a failure of the file system to an error with a remedy.

    Raises:
        ModtError: the file cannot be written.
    """
    try:
        yield
    except OSError as error:
        cause = f"cannot be written ({error.strerror or error})"
        remedy = "free or unlock the disk, or give another --out; what was recorded before is intact"
        raise ModtError(path, cause, remedy) from None


class LineFile:
    """An unbuffered text file of whole lines."""

    def __init__(self, path: Path) -> None:
        self.path = path
        with writing(path):
            self._file: BinaryIO = path.open("wb", buffering=0)

    def write(self, text: str) -> None:
        """Append lines; a partial line on a full disk is removed.

        Raises:
            ModtError: the file cannot be written.
        """
        data = text.encode()
        with writing(self.path):
            whole = self._file.tell()
            try:
                written = 0
                while written < len(data):
                    written += self._file.write(data[written:])
            except OSError:
                with suppress(OSError):
                    self._file.truncate(whole)
                raise

    def close(self) -> None:
        """Close the file."""
        with writing(self.path):
            self._file.close()
