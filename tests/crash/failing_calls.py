"""System calls that fail at the numbers that a test gives, and clocks that the test sets."""

from __future__ import annotations

import builtins
import errno
import io
import os
import socket
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np

from modt.energy.meters.meter import MeterLostError
from modt.sources.live.packets import PAUSE_S

DISK = (errno.EIO, errno.ENOSPC, errno.EROFS, errno.EMFILE, errno.ENOENT, errno.EACCES, errno.ESTALE)
NETWORK = (errno.ENETDOWN, errno.ENOBUFS, errno.ECONNREFUSED, errno.EPERM, errno.EAGAIN, errno.EBADF)
STEPS_S = (-3600.0, -1.0, 1.0, 3600.0)
READINGS = (float("nan"), -1e300, 1e300, 0.0)
FILES = (
    "open",
    "fsync",
    "rename",
    "replace",
    "mkdir",
    "unlink",
    "rmdir",
    "stat",
    "lstat",
    "fstat",
    "listdir",
    "scandir",
)
SOCKETS = ("sendto", "recvmsg", "settimeout")


class File:
    """A file whose calls may fail."""

    def __init__(self, faults: Faults, file: Any, name: str) -> None:
        self._faults = faults
        self._file = file
        self._name = name

    def __getattr__(self, name: str) -> Any:
        call = getattr(self._file, name)
        if name not in ("write", "flush", "truncate", "seek", "tell", "read", "close"):
            return call
        return lambda *given: self._faults.call(f"{name} {self._name}", call, *given)

    def __iter__(self) -> Iterator[Any]:
        return iter(self._file)

    def __enter__(self) -> File:
        return self

    def __exit__(self, *_: object) -> None:
        self._file.close()


class Faults:
    """Counts the system calls of a run, and fails those whose numbers are given.

    Attributes:
        calls: names of the calls, in order.
        now_s: the monotonic clock.
        calendar_s: time by which the calendar is ahead of it.
        last_s: time of the last fault; minus infinity before.
    """

    def __init__(self, folder: Path, failing: Mapping[int, int], lasting_s: float = 0.0) -> None:
        """`failing`: way to fail, by the number of a call; calls of its kind fail for `lasting_s` after it."""
        self.calls = list[str]()
        self.now_s = 100.0
        self.calendar_s = 1.7e9
        self.last_s = -np.inf
        self.active = False
        self._folder = str(folder)
        self._failing = failing
        self._lasting_s = lasting_s
        self._lasting = dict[str, tuple[float, int]]()

    def call(self, name: str, call: Callable[..., Any], *given: Any, **options: Any) -> Any:
        """Make a call, or fail it."""
        if not self.active:
            return call(*given, **options)
        way = self._failing.get(len(self.calls))
        self.calls.append(name)
        kind = name.split(maxsplit=1)[0]
        if way is not None:
            self._lasting[kind] = self.now_s + self._lasting_s, way
        until_s, lasting = self._lasting.get(kind, (-np.inf, 0))
        if way is None and self.now_s >= until_s:
            return call(*given, **options)
        self.last_s = self.now_s
        return self._fail(kind, lasting if way is None else way, call, given, options)

    def _fail(self, kind: str, way: int, call: Callable[..., Any], given: Any, options: Any) -> Any:
        if kind == "calendar":
            self.calendar_s += STEPS_S[way % len(STEPS_S)]
        elif kind == "monotonic":
            self.now_s += (0.5, 6.0)[way % 2]
            self.last_s = self.now_s
        elif kind == "meter":
            if way % 6 < len(READINGS):
                return READINGS[way % 6]
            raise (MeterLostError("unplugged"), OSError(errno.EIO, "Input/output error"))[way % 2]
        elif kind in SOCKETS:
            number = NETWORK[way % len(NETWORK)]
            raise OSError(number, os.strerror(number))
        else:
            if kind == "write" and isinstance(given[0], bytes) and way % 3 == 0:
                call(given[0][: len(given[0]) // 2])  # a disk that becomes full
            if kind == "close":
                call(*given, **options)
            number = DISK[way % len(DISK)]
            raise OSError(number, os.strerror(number))
        return call(*given, **options)

    def ours(self, place: Any) -> str:
        """File name of a path or descriptor of the run; empty for other files and those in memory."""
        try:
            path = os.readlink(f"/proc/self/fd/{place}") if isinstance(place, int) else os.fspath(place)
        except (OSError, TypeError):
            return ""
        path = path.decode() if isinstance(path, bytes) else path
        if path.startswith(f"{self._folder}/memory"):
            return ""
        if path.startswith((self._folder, "/proc/")) or self._folder.startswith(path):
            return path.rpartition("/")[2] or "/"
        return ""

    @contextmanager
    def installed(self) -> Iterator[None]:
        """Context in which the system calls and the clocks are replaced."""
        with ExitStack() as stack:
            for name in FILES:
                stack.enter_context(patch.object(os, name, self._file_call(name, getattr(os, name))))
            opened = self._opener(io.open)
            stack.enter_context(patch.object(io, "open", opened))
            stack.enter_context(patch.object(builtins, "open", opened))
            for name in SOCKETS:
                stack.enter_context(patch.object(socket.socket, name, self._socket_call(name)))
            stack.enter_context(patch.object(time, "monotonic", self.monotonic))
            stack.enter_context(patch.object(time, "time", self.calendar))
            yield

    def monotonic(self) -> float:
        """Monotonic clock. It leaps as it does after the process was stopped."""
        self.call("monotonic", lambda: None)
        return self.now_s

    def calendar(self) -> float:
        """Calendar clock. It steps as it does when it is set."""
        self.call("calendar", lambda: None)
        return self.now_s + self.calendar_s

    def _file_call(self, name: str, call: Any) -> Any:
        def called(*given: Any, **options: Any) -> Any:
            ours = self.ours(given[0]) if given and self.active else ""
            return self.call(f"{name} {ours}", call, *given, **options) if ours else call(*given, **options)

        return called

    def _opener(self, call: Any) -> Any:
        def opened(file: Any, *given: Any, **options: Any) -> Any:
            ours = self.ours(file) if self.active else ""
            if not ours:
                return call(file, *given, **options)
            return File(self, self.call(f"open {ours}", call, file, *given, **options), ours)

        return opened

    def _socket_call(self, name: str) -> Any:
        call = getattr(socket.socket, name)

        def called(bound: socket.socket, *given: Any) -> Any:
            if name == "settimeout":
                given = (0.0,)
            try:
                return self.call(f"{name} {bound.family.name}", call, bound, *given)
            except BlockingIOError:
                self.now_s += PAUSE_S if name == "recvmsg" else 0.0
                raise

        return called
