"""A short run of a service whose calls of the system fail where a test says; it keeps time by a clock of its own.

Everything runs in one thread, so that the calls of a run are always the same: a run without faults lists them, and
each of the others fails some by their numbers.
"""

from __future__ import annotations

import builtins
import errno
import io
import json
import os
import socket
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from types import SimpleNamespace
from typing import Any
from unittest.mock import patch

import numpy as np

from modt.app import metering
from modt.app.containment import Containment
from modt.app.deadlines import Deadlines
from modt.app.loop import Stop
from modt.app.session import Session
from modt.app.status import STALE_S
from modt.app.supervisor import Supervisor
from modt.cli.status import read
from modt.config import ProfileConfig, RecordingConfig
from modt.energy.ledger import SCHEMA as LEDGER_SCHEMA
from modt.energy.ledger import Ledger
from modt.energy.meters.meter import Conditions, Facts, Kind, Meter, MeterLostError, Scope
from modt.energy.windows import SCHEMA as ENERGY_SCHEMA
from modt.energy.windows import Clocks, Windows
from modt.errors import ModtError
from modt.reporting.summary import Summary
from modt.sinks import run_directory
from modt.sinks.background import Background
from modt.sinks.datagrams import Datagrams
from modt.sinks.output import LineFile
from modt.sinks.recording import AtOnce, Recording
from modt.sinks.records import read_records
from modt.sinks.run_directory import RunDirectory
from modt.sinks.tracks import SCHEMA, frame_line
from modt.sources.live import live_stream
from modt.sources.live.live_stream import LiveStream
from modt.sources.live.packets import PAUSE_S, PacketReader
from modt.sources.packets.velodyne import STAMP_AT, VelodyneDecoder
from modt.sources.pose_socket import PoseSocket
from modt.sources.stream import StreamInfo
from modt.types import UNLIMITED, Frame
from tests.results import CAR, result
from tests.sequences.live_world import HOUR_US, turn

TURNS, TURN_S = 40, 0.1
BACK_S = 2.0
"""Time from the end of a fault until everything is recorded [s]."""
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
        self._faults, self._file, self._name = faults, file, name

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
    """Counts the calls of the system that a run makes, and fails those that are given by their numbers.

    Attributes:
        calls: what was called, in order.
        now_s: the monotonic clock.
        calendar_s: time by which the calendar is ahead of it.
        last_s: time of the last fault; minus infinity before.
    """

    def __init__(self, folder: Path, failing: Mapping[int, int], lasting_s: float = 0.0) -> None:
        """`failing`: for the numbers of calls, which of the ways to fail; `lasting_s`: likewise afterwards."""
        self.calls = list[str]()
        self.now_s, self.calendar_s, self.last_s = 100.0, 1.7e9, -np.inf
        self.active = False
        self._folder, self._failing, self._lasting_s = str(folder), failing, lasting_s
        self._lasting = dict[str, tuple[float, int]]()

    def call(self, name: str, call: Callable[..., Any], *given: Any, **options: Any) -> Any:
        """Make a call, unless it is to fail."""
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
        """Name of a path or a descriptor in the list of calls; empty if it is none of the run's, or is in memory."""
        try:
            path = self._readlink(f"/proc/self/fd/{place}") if isinstance(place, int) else os.fspath(place)
        except (OSError, TypeError):
            return ""
        path = path.decode() if isinstance(path, bytes) else path
        if path.startswith(f"{self._folder}/memory"):
            return ""
        if path.startswith((self._folder, "/proc/")) or self._folder.startswith(path):
            return path.rpartition("/")[2] or "/"
        return ""

    _readlink = staticmethod(os.readlink)

    @contextmanager
    def installed(self) -> Iterator[None]:
        """Take the place of the system's calls, and of its clocks."""
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
        """The clock that nobody sets; it may leap, as when the process was stopped."""
        self.call("monotonic", lambda: None)
        return self.now_s

    def calendar(self) -> float:
        """The clock that may be set."""
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


class InTurn(Background[Any]):
    """A background writer that works when it is given something."""

    def __init__(self, name: str, writer: Any, faults: Faults, encode: Callable[[Any], Any] | None = None) -> None:
        with patch("threading.Thread.start"):
            super().__init__(name, writer, 128, encode=encode, retry_s=0.0, clock=lambda: faults.now_s)

    def _put(self, job: Callable[[], None]) -> None:
        try:
            job()
        except Exception as error:
            self._fail(error)
        else:
            self._succeed()

    def close(self) -> None:
        self._writer.close()


class Turns(LiveStream):
    """Receives when the loop takes, what the sensor and the odometry have sent until then."""

    def __init__(self, faults: Faults, reader: PacketReader, send: Callable[[], None]) -> None:
        info = StreamInfo("sensor", "test", 0, None, TURN_S, None, has_poses=False)
        super().__init__(info, reader, clock=faults.monotonic, pause=lambda seconds: None)
        self._faults, self._send, self.turn = faults, send, 0

    def start(self) -> None:
        """Nothing to start."""

    def take(self, timeout_s: float) -> Any:
        """The sweep of the next turn."""
        self.turn += 1
        self._faults.now_s += TURN_S
        self._send()
        for _ in range(2):
            self._read()
        return super().take(0.0)


class Stages:
    """Stages that are no part of the test, and the poses, which are."""

    info = StreamInfo("sensor", "test", 0, None, TURN_S, None, has_poses=False)
    request = SimpleNamespace(mode="accurate", fov="full")
    chosen = SimpleNamespace(name="default", config=ProfileConfig())
    config, misfits = chosen.config, 0
    budget = UNLIMITED

    def __init__(self, odometry: PoseSocket) -> None:
        self.odometry, self.ledger = odometry, Ledger()
        decision = SimpleNamespace(frequency=np.full(4, 0.25))
        self.pipeline = SimpleNamespace(segmenter=SimpleNamespace(facts=dict), decision=decision)

    def recognise(self, first: Frame, named: str | None) -> None:
        """It is the sensor that was expected."""

    def step(self, frame: Frame, budget: Any, *, reduced: bool) -> Any:
        """A car."""
        self.odometry.place(frame)
        return result(frame.index, [5, 4], {0: 1, 1: 2}, {1: CAR})

    def watch(self, frame: Frame) -> None:
        """It stays the same sensor."""

    def recover(self, *, anew: bool) -> None:
        """No frame fails here."""
        raise AssertionError("a frame failed")


class FaultyRun:
    """A service of `TURNS` turns of a sensor with odometry, records, sinks, metrics and a meter."""

    def __init__(self, folder: Path, failing: Mapping[int, int], lasting_s: float = 0.0) -> None:
        self.out, self.faults = folder / "state" / "run", Faults(folder, failing, lasting_s)
        self.handed = {SCHEMA: 0, LEDGER_SCHEMA: 0, ENERGY_SCHEMA: 0}
        self.unread = list[str]()
        self.frames: dict[int, float] = {}
        self._folder = folder

    def run(self) -> None:
        """From the start to a signal.

        Raises:
            Exception: what has ended the run.
        """
        faults, folder = self.faults, self._folder
        with ExitStack() as stack:
            sensor, odometry, notified, sender = (
                stack.enter_context(socket.socket(family, socket.SOCK_DGRAM))
                for family in (socket.AF_INET, socket.AF_INET, socket.AF_UNIX, socket.AF_INET)
            )
            for bound in (sensor, odometry):
                bound.bind(("127.0.0.1", 0))
                bound.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 1 << 20)
            notified.bind(str(folder / "notify"))
            notified.setblocking(False)
            posed, received = odometry.getsockname(), sensor.getsockname()
            reader = PacketReader(sensor, VelodyneDecoder("sensor"), clock=faults.calendar)
            poses, payloads = PoseSocket(odometry, ProfileConfig().odometry, "odometry"), turn("vlp-16")
            plain = socket.socket.__base__.sendto  # type: ignore[union-attr]

            def send() -> None:
                for k, payload in enumerate(payloads):
                    stamp_us = round((faults.now_s + TURN_S * (k / len(payloads) - 1)) * 1e6) % HOUR_US
                    stamp = stamp_us.to_bytes(4, "little")
                    plain(sender, payload[:STAMP_AT] + stamp + payload[STAMP_AT + 4 :], received)
                pose = {"stamp": faults.now_s + faults.calendar_s, "x": faults.now_s, "y": 0.0, "yaw": 0.0}
                plain(sender, json.dumps(pose).encode(), posed)

            source = Turns(faults, reader, send)
            sinks = {
                "file": InTurn("file", LineFile[str](folder / "sink.jsonl", mode="ab"), faults, frame_line),
                "unix": Datagrams("unix", socket.AF_UNIX, str(folder / "notify")),
            }
            recording = Recording(
                RunDirectory(self.out),
                RecordingConfig(disk_mb=1.0),
                InTurn("recording", AtOnce(), faults),
                lambda: "schema: modt.run/1\nservice: true\n",
                lambda: faults.now_s,
            )
            self._count(recording)
            deadlines, stop = Deadlines(TURN_S, lambda: faults.now_s), Stop()
            meter = Meter(
                Facts("test", "J", 1e-6, 100.0, Scope.BOARD, Kind.MEASURED),
                lambda: faults.call("meter", self._joules),
            )
            stages: Any = Stages(poses)
            supervisor = Supervisor(str(folder / "notify"), 1.0, clock=lambda: faults.now_s)
            stack.enter_context(patch.object(metering, "windows", self._windows))
            stack.enter_context(patch.object(live_stream, "READ_S", PAUSE_S))
            (folder / "memory").mkdir()
            stack.enter_context(patch.object(run_directory, "MEMORY", folder / "memory"))
            stack.enter_context(faults.installed())
            session = Session(
                source, stages, recording, sinks, deadlines, Containment(), stop, Summary(), [meter], None,
                metrics=folder / "modt.prom", clock=lambda: faults.now_s,
            )  # fmt: skip
            self.session = session

            def tick(taken: Any) -> None:
                self.frames[taken.frame.index] = faults.now_s
                with suppress(BlockingIOError):
                    while True:
                        socket.socket.__base__.recv(notified, 65_536)  # type: ignore[union-attr]

            report = session.loop._report

            def reported(supervisor: Any) -> None:
                report(supervisor)
                self._look()
                if source.turn >= TURNS:
                    stop.signal = "SIGTERM"

            session.loop._report = reported
            faults.active = True
            try:
                session.run(supervisor, tick)
            finally:
                faults.active = False

    def check(self) -> None:
        """Check the promises that hold after every run."""
        assert not self.unread, self.unread
        records: dict[str, list[Any]] = {SCHEMA: [], LEDGER_SCHEMA: [], ENERGY_SCHEMA: []}
        for part in self.out.parent.glob("run*"):
            for name, schema in (("tracks.jsonl", SCHEMA), ("ledger.jsonl", LEDGER_SCHEMA)):
                if (part / name).exists():
                    records[schema] += [r["frame"] for r in read_records(part / name, schema, (ENERGY_SCHEMA,))]
            if (part / "ledger.jsonl").exists():
                kept = read_records(part / "ledger.jsonl", ENERGY_SCHEMA, (LEDGER_SCHEMA,))
                records[ENERGY_SCHEMA] += [r["window"] for r in kept]
        health = self.session.recording.health()
        missing = sum(self.handed.values()) - sum(map(len, records.values()))
        for schema, numbers in records.items():
            assert len(numbers) == len({*numbers}), f"{schema} twice"
        assert missing <= health["lost_lines"], f"{missing} lines are missing, {health['lost_lines']} are counted"
        late = {frame for frame, at_s in self.frames.items() if at_s > self.faults.last_s + BACK_S}
        assert late <= {*records[SCHEMA]}, "frames are missing after the fault"
        if self.faults.last_s + BACK_S < self.faults.now_s - 1.0:
            assert late, "no frame after the fault"

    def _count(self, recording: Recording) -> None:
        write, ledger = recording.write, recording.ledger

        def write_counted(taken: Any) -> None:
            self.handed[SCHEMA] += 1
            write(taken)

        def ledger_counted(record: Any) -> None:
            self.handed[record["schema"]] += 1
            ledger(record)

        recording.write, recording.ledger = write_counted, ledger_counted  # type: ignore[method-assign]

    def _windows(self, meters: Any, core: int | None) -> Windows:
        faults = self.faults
        clocks = Clocks(
            lambda: int(1e9 * faults.monotonic()),
            lambda: int(1e9 * faults.monotonic()),
            lambda: int(1e9 * faults.now_s),
        )
        return Windows(meters, clocks, Conditions(0))

    def _joules(self) -> float:
        return 5.0 * self.faults.now_s

    def _look(self) -> None:
        """The status is there, and not old."""
        self.faults.active = False
        try:
            age_s = self.faults.now_s + self.faults.calendar_s - read(self.out)["time_s"]
            # A step of the calendar shows as an age until the next status.
            if abs(age_s) >= STALE_S and self.faults.now_s > self.faults.last_s + BACK_S:
                self.unread.append(f"the status is {age_s:.1f} s old")
        except ModtError as error:
            self.unread.append(str(error))
        finally:
            self.faults.active = True
