"""Output files: unbuffered writes, and failures as errors with a remedy."""

from __future__ import annotations

import os
import threading
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from io import FileIO
from pathlib import Path
from typing import Generic, Literal, Protocol, TypeVar, runtime_checkable

from modt.energy.ledger import LedgerLine
from modt.energy.windows import EnergyWindow
from modt.errors import ModtError
from modt.types import FrameResult

WRITE_REMEDY = "free or unlock the disk, or give another --out; what was recorded before is intact"
T = TypeVar("T")
T_contra = TypeVar("T_contra", contravariant=True)
Health = dict[str, int | str]
"""Number of items `written`, of those lost for each reason, and the `state` of the writer in words."""


class Writer(Protocol[T_contra]):
    """Takes items one by one."""

    def write(self, item: T_contra, /) -> None:
        """Write one item. On return the operating system has it, or a thread that writes (`Background`)."""

    def close(self) -> None:
        """Close the files, where any stay open."""
        return  # writers inherit it; a protocol's method without a statement is abstract


class Sink(Writer[FrameResult], Protocol):
    """Takes the results of frames."""

    def health(self) -> Health:
        """Counts of the frames so far by their fate."""


@runtime_checkable
class LedgerSink(Protocol):
    """A sink that also takes the lines of the ledger."""

    def ledger(self, line: LedgerLine | EnergyWindow, /) -> None:
        """Write the costs of a frame, or the energy of a window."""


@runtime_checkable
class StatusSink(Protocol):
    """A sink that also shows the status of a service."""

    def status(self, words: str, metrics: str, /) -> None:
        """Replace the status, a line of words and metrics for Prometheus, without waiting."""


@contextmanager
def writing(path: Path, remedy: str = WRITE_REMEDY) -> Iterator[None]:
    """Convert a failure of the file system to an error with a remedy.

    Raises:
        ModtError: the file cannot be written.
    """
    try:
        yield
    except OSError as error:
        raise ModtError(path, f"cannot be written ({error.strerror or error})", remedy) from None


def without_links(path: str, flags: int) -> int:
    """Opener of files that follows no link at the end of a path, which somebody else may have put there."""
    return os.open(path, flags | os.O_NOFOLLOW | os.O_CLOEXEC, 0o666)


def opened(path: Path, mode: Literal["wb", "ab"]) -> FileIO:
    """An unbuffered file, opened without following a link."""
    return open(path, mode, buffering=0, opener=without_links)


def replace_file(path: Path, text: str, *, lasting: bool = False, public: bool = False) -> None:
    """Write a file atomically through .NAME.part, without following links.

    A lasting file survives a power cut whole. A public one may be read by every user, whatever the umask.

    Raises:
        ModtError: the file cannot be written.
    """
    partial = path.with_name(f".{path.name}.part")
    with writing(path):
        partial.unlink(missing_ok=True)
        try:
            number = os.open(partial, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_NOFOLLOW, 0o666)
            with open(number, "w", encoding="utf-8") as file:
                if public:
                    os.fchmod(number, 0o644)
                file.write(text)
                file.flush()
                if lasting:
                    os.fsync(number)
            partial.replace(path)
        except OSError:
            with suppress(OSError):
                partial.unlink()
            raise


class LineFile(Generic[T]):
    """An unbuffered text file of whole lines. `encode` gives the lines of an item.

    Mode "ab" continues a file, "wb" begins a new one.
    """

    def __init__(self, path: Path, encode: Callable[[T], str] = str, mode: Literal["wb", "ab"] = "wb") -> None:
        self.path = path
        self._encode = encode
        self._written = 0
        with writing(path):
            self._file = opened(path, mode)

    def write(self, item: T, /) -> None:
        """Append the lines of an item. A partial line on a full disk is removed.

        Raises:
            ModtError: the file cannot be written.
            ValueError: the item cannot be encoded.
        """
        data = self._encode(item).encode()
        with writing(self.path):
            whole = self._file.tell()
            try:
                written = 0
                while written < len(data):
                    written += self._file.write(data[written:])
            except OSError:
                with suppress(OSError):
                    self._file.truncate(self._file.seek(whole))  # the next line begins where this one did
                raise
        self._written += 1

    def renew(self) -> None:
        """Go on in a file under its path, as the present one has been renamed or removed.

        Raises:
            ModtError: the new file cannot be opened; the present one stays in use.
        """
        with writing(self.path):
            renamed = self._file
            self._file = opened(self.path, "ab")
            renamed.close()

    def sync(self) -> None:
        """Make all written lines survive a power cut, and wait for the disk.

        Raises:
            ModtError: the disk reports a failure.
        """
        with writing(self.path):
            os.fsync(self._file.fileno())

    def present(self) -> bool:
        """Whether its path leads to this file."""
        with suppress(OSError):
            return os.path.samestat(os.fstat(self._file.fileno()), os.stat(self.path))
        return False

    def removed(self) -> bool:
        """Whether the file has lost its name, so that closing it loses its content."""
        with suppress(OSError):
            return os.fstat(self._file.fileno()).st_nlink == 0
        return False

    def health(self) -> Health:
        """The items written."""
        return {"written": self._written}

    def close(self) -> None:
        """Close the file."""
        with writing(self.path):
            self._file.close()


def close_together(sinks: Iterable[Sink]) -> None:
    """Close sinks in parallel, so that hanging ones share one time limit."""
    threads = [threading.Thread(target=sink.close) for sink in sinks]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
