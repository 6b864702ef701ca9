"""The directory of a run: DIR holds the present part of its records, DIR~1, DIR~2 … hold earlier ones."""

from __future__ import annotations

import fcntl
import hashlib
import os
import re
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path

from modt.errors import ModtError
from modt.sinks.output import replace_file, writing

RUN = "run.yaml"
TRACKS = "tracks.jsonl"
LEDGER = "ledger.jsonl"
SUMMARY = "summary.json"
STATUS = "status.json"
MARK = "service: true"
"""Line of run.yaml in the directories of a service. No other directory is ever deleted."""
MEMORY = Path("/dev/shm")
"""Folder of the status while the disk of the records cannot be written."""
LOCK_ATTEMPTS = 3
"""Attempts to lock the file of the lock, which a run that ends may remove between opening and locking."""
_KNOWN = {form.format(name) for name in (RUN, TRACKS, LEDGER, SUMMARY, STATUS) for form in ("{}", ".{}.part")}


def status_paths(directory: Path) -> tuple[Path, Path]:
    """Paths of the status of a run: beside its records, and in memory while those cannot be written."""
    return directory / STATUS, MEMORY / _memory_name(directory)


def _memory_name(directory: Path) -> str:
    """Name of the status in memory. It reads the disk, which may hang later."""
    return f"modt-{hashlib.sha256(os.fsencode(directory.resolve())).hexdigest()[:16]}.json"


class RunDirectory:
    """The parts of a run. Each is complete in itself. An incomplete one, left by a failed start, is replaced.

    Attributes:
        path: the directory.
        previous: new path of the previous part, None if there was none.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.previous: Path | None = None
        self._locked = False  # within `locked`, so that each new part keeps the lock
        self._lock = ExitStack()
        self._shut_out = False  # another run has the lock
        self._lock_file: int | None = None  # its descriptor
        self._memory_name = _memory_name(path)
        self._disk = next(folder for folder in path.absolute().parents if os.path.ismount(folder))

    def foreign(self) -> tuple[str, str] | None:
        """Why no records can be kept here, and the remedy: the path is a file, or a directory with other files."""
        if self.path.exists() and not self.path.is_dir():
            return "is a file", "give a directory as --out"
        others = sorted({p.name for p in self.path.iterdir()} - _KNOWN) if self.path.is_dir() else []
        if others and not (self.path / TRACKS).exists():
            return f"holds {others[0]}, which is no record", "give an empty or a new directory"
        return None

    @contextmanager
    def locked(self) -> Iterator[None]:
        """Lock out other runs within the context. If no lock can be written, no run is locked out.

        Raises:
            ModtError: another run holds the lock.
        """
        with ExitStack() as self._lock:
            self._locked = True
            self._take_lock()
            try:
                yield
            finally:
                self.in_memory(None)
                self._remove_lock()

    def begin(self, description: str, limit_bytes: float) -> None:
        """Rename the previous part, delete the oldest parts beyond a limit, and begin a new part.

        Raises:
            ModtError: the disk is full, or cannot be written, or the directory is not for records.
        """
        with writing(self.path):
            if reason := self.foreign():
                raise ModtError(self.path, *reason)
            if not os.path.ismount(self._disk):
                raise OSError(f"{self._disk} is not mounted")
            if self._locked:
                self._take_lock()
            self._set_aside()
            self._delete_oldest(limit_bytes)
            self.path.mkdir(parents=True, exist_ok=True)
        self.write(RUN, description, lasting=True)

    def write(self, name: str, text: str, *, lasting: bool = False) -> None:
        """Write a file of the present part atomically. A lasting file survives a power cut whole.

        Raises:
            ModtError: it cannot be written.
        """
        replace_file(self.path / name, text, lasting=lasting)

    def present(self) -> bool:
        """Whether the present part is at its path."""
        return os.path.isfile(self.path / RUN)

    def in_memory(self, status: str | None) -> None:
        """Keep the status in memory. None removes it. Failures are ignored. Another run's status is left alone."""
        if self._shut_out:
            return
        memory = MEMORY / self._memory_name
        with suppress(OSError, ModtError):
            if status is None:
                memory.unlink(missing_ok=True)
            else:
                replace_file(memory, status)

    def sync(self) -> None:
        """Make the names of the present part and its files survive a power cut.

        Raises:
            ModtError: the disk reports a failure.
        """
        with writing(self.path):
            for folder in (self.path, self.path.parent):
                number = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
                try:
                    os.fsync(number)
                finally:
                    os.close(number)

    def kept(self) -> list[Path]:
        """Earlier parts, the oldest first."""
        return [path for _, path in sorted(self._numbered()) if _is_ours(path)]

    def _take_lock(self) -> None:
        """Take the lock, or take it once more if its file was removed together with the folder around the run."""
        if self._holds_lock():
            return
        self._lock.close()
        self._lock_file = None
        self._shut_out = False
        try:
            self.path.parent.mkdir(parents=True, exist_ok=True)
            for _ in range(LOCK_ATTEMPTS):
                self._lock.close()
                number = os.open(self._lock_path, os.O_RDONLY | os.O_CREAT | os.O_NOFOLLOW)
                self._lock.callback(os.close, number)
                fcntl.flock(number, fcntl.LOCK_EX | fcntl.LOCK_NB)
                self._lock_file = number
                if self._holds_lock():
                    return
        except BlockingIOError:
            self._shut_out = True
            remedy = "end it, or give another --out"
            raise ModtError(self.path, "another run of modt records into it", remedy) from None
        except OSError:  # the recording reports it when it begins
            pass

    @property
    def _lock_path(self) -> Path:
        """File of the lock. It lies beside the directory, which is renamed, and only while a run records."""
        return self.path.with_name(f".{self.path.name}.lock")

    def _holds_lock(self) -> bool:
        """Whether this run has locked the file that is at the path."""
        with suppress(OSError):
            return self._lock_file is not None and os.path.samestat(
                os.fstat(self._lock_file), os.stat(self._lock_path)
            )
        return False

    def _remove_lock(self) -> None:
        if self._holds_lock():
            with suppress(OSError):
                self._lock_path.unlink()

    def _numbered(self) -> Iterator[tuple[int, Path]]:
        for path in self.path.parent.glob("*~*"):
            match = re.fullmatch(re.escape(self.path.name) + r"~(\d+)", path.name)
            if match:
                yield int(match[1]), path

    def _set_aside(self) -> None:
        """Rename the previous part, or remove one without any record."""
        if not self.path.is_dir():
            return
        if any((self.path / name).is_file() for name in (TRACKS, LEDGER)):
            (self.path / STATUS).unlink(missing_ok=True)
            number = 1 + max((n for n, _ in self._numbered()), default=0)
            self.previous = self.path.rename(self.path.with_name(f"{self.path.name}~{number}"))
        else:
            _remove_known(self.path)

    def _delete_oldest(self, limit_bytes: float) -> None:
        """Delete the oldest parts of services until the rest keeps to the limit."""
        parts = [(path, _size(path)) for path in self.kept()]
        excess = sum(size for _, size in parts) - limit_bytes
        for path, size in parts:
            if excess <= 0:
                return
            _remove_known(path)
            with suppress(OSError):  # it holds foreign files
                path.rmdir()
            excess -= size


def _is_ours(path: Path) -> bool:
    try:
        return MARK in (path / RUN).read_text(encoding="utf-8").splitlines()
    except OSError:
        return False


def _size(path: Path) -> int:
    return sum(file.stat().st_size for file in path.iterdir() if file.name in _KNOWN)


def _remove_known(path: Path) -> None:
    for name in _KNOWN - {RUN}:
        (path / name).unlink(missing_ok=True)
    (path / RUN).unlink(missing_ok=True)  # last, so that a half deleted part is recognised as ours
