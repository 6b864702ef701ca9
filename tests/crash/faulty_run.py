"""A short run of a service whose system calls fail at the numbers that a test gives, on a clock of the test.

Everything runs in one thread, so that the calls of a run are always the same: a run without faults lists them, and
each of the others fails some by their numbers.
"""

from __future__ import annotations

import json
import socket
from collections.abc import Callable, Mapping
from contextlib import ExitStack, suppress
from pathlib import Path
from types import SimpleNamespace
from typing import Any
from unittest.mock import Mock, patch

import numpy as np

from modt.app import loop as loops
from modt.app.deadlines import Deadlines
from modt.app.failures import Failures
from modt.app.loop import Service
from modt.app.status import STALE_S
from modt.app.stop import Stop
from modt.app.systemd import Notifier
from modt.app.trust_report import TrustReport
from modt.cli.status import read
from modt.config import ProfileConfig, RecordingConfig
from modt.energy.ledger import SCHEMA as LEDGER_SCHEMA
from modt.energy.ledger import Ledger
from modt.energy.meters.meter import Conditions, Facts, Kind, Meter, Scope
from modt.energy.windows import SCHEMA as ENERGY_SCHEMA
from modt.energy.windows import Clocks, Windows
from modt.errors import ModtError
from modt.poses.pose_socket import PoseSocket
from modt.sinks import run_directory
from modt.sinks.background import Background
from modt.sinks.frame_lines import Datagrams
from modt.sinks.output import LineFile
from modt.sinks.recording import AtOnce, Recording
from modt.sinks.run_directory import RunDirectory
from modt.sinks.tracks import SCHEMA, frame_line
from modt.sources.drivers.velodyne import VelodyneDecoder
from modt.sources.live import live_stream
from modt.sources.live.live_stream import LiveStream
from modt.sources.live.packets import PAUSE_S, PacketReader
from modt.sources.stream import StreamInfo
from modt.types import UNLIMITED, Frame
from modt_profiling.reporting.records import read_records
from tests.crash.failing_calls import Faults
from tests.results import TWO, result
from tests.sequences.makers import MAKERS

TURNS = 40
TURN_S = 0.1
INFO = StreamInfo("sensor", "test", 0, None, TURN_S, None, has_poses=False)
BACK_S = 2.0
"""Time from the end of a fault until everything is recorded [s]."""


class InTurn(Background[Any]):
    """A background writer that runs each job in the calling thread."""

    def __init__(self, name: str, writer: Any, faults: Faults, encode: Callable[[Any], Any] | None = None) -> None:
        with patch("threading.Thread.start"):
            super().__init__(name, writer, 128, encode=encode, retry_s=0.0, clock=lambda: faults.now_s)

    def _put(self, job: Callable[[], None], on_drop: Callable[[], None] = lambda: None) -> None:
        self._attempt(job)

    def close(self) -> None:
        self._writer.close()


class Turns(LiveStream):
    """A live stream that receives in the thread of the loop: each `take` reads the packets sent until then."""

    def __init__(self, faults: Faults, reader: PacketReader, send: Callable[[], None]) -> None:
        super().__init__(INFO, reader, clock=faults.monotonic, pause=lambda seconds: None)
        self._faults = faults
        self._send = send
        self.turn = 0

    def start(self) -> None:
        """No effect."""

    def take(self, timeout_s: float) -> Any:
        """The sweep of the next turn."""
        self.turn += 1
        self._faults.now_s += TURN_S
        self._send()
        for _ in range(2):
            self._read()
        return super().take(0.0)


def stages_with(odometry: PoseSocket) -> Mock:
    """Stages that see a car, with the poses of the test. Only the poses are tested."""

    def step(frame: Frame, budget: Any, *, reduced: bool) -> Any:
        odometry.place(frame)
        return result(frame.index, *TWO)

    request = SimpleNamespace(mode="accurate", fov="full")
    config = ProfileConfig()
    chosen = SimpleNamespace(name="default", config=config)
    decision = SimpleNamespace(frequency=np.full(4, 0.25))
    pipeline = SimpleNamespace(view=SimpleNamespace(facts=dict), decision=decision)
    stages = Mock(info=INFO, request=request, chosen=chosen, config=config, misfits=0, budget=UNLIMITED, step=step)
    stages.configure_mock(odometry=odometry, ledger=Ledger(), pipeline=pipeline)
    stages.configure_mock(run_id="", trust=TrustReport(config.sensor), source_findings={})
    stages.recover.side_effect = AssertionError("a frame failed")
    return stages


class FaultyRun:
    """A service of `TURNS` turns of a sensor with odometry, records, sinks, metrics and a meter."""

    def __init__(self, folder: Path, failing: Mapping[int, int], lasting_s: float = 0.0) -> None:
        self.out = folder / "state" / "run"
        self.faults = Faults(folder, failing, lasting_s)
        self.unread = list[str]()
        self.frames: dict[int, float] = {}
        self._folder = folder

    def run(self) -> None:
        """Run from the start to a signal.

        Raises:
            Exception: the error that has ended the run.
        """
        faults = self.faults
        folder = self._folder
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
            posed = odometry.getsockname()
            received = sensor.getsockname()
            reader = PacketReader(sensor, VelodyneDecoder("sensor"), clock=faults.calendar)
            poses = PoseSocket(odometry, ProfileConfig().odometry, "odometry")
            maker = MAKERS["velodyne"]
            payloads = maker.turns()[0]
            plain = socket.socket.__base__.sendto  # type: ignore[union-attr]

            def send() -> None:
                for k, payload in enumerate(payloads):
                    at_s = faults.now_s + TURN_S * (k / len(payloads) - 1)
                    plain(sender, maker.stamped(payload, at_s), received)
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
            for name in ("write", "ledger"):
                setattr(recording, name, Mock(wraps=getattr(recording, name)))
            deadlines = Deadlines(TURN_S, lambda: faults.now_s)
            stop = Stop()
            meter = Meter(
                Facts("test", "J", 1e-6, 100.0, Scope.BOARD, Kind.MEASURED),
                lambda: faults.call("meter", lambda: 5.0 * faults.now_s),
            )
            stages = stages_with(poses)
            notifier = Notifier(str(folder / "notify"), 1.0, clock=lambda: faults.now_s)
            stack.enter_context(patch.object(loops, "Windows", self._windows))
            stack.enter_context(patch.object(live_stream, "READ_S", PAUSE_S))
            (folder / "memory").mkdir()
            stack.enter_context(patch.object(run_directory, "MEMORY", folder / "memory"))
            stack.enter_context(faults.installed())
            service = Service(
                source=source,
                stages=stages,
                recording=recording,
                sinks=sinks,
                deadlines=deadlines,
                failures=Failures(),
                stop=stop,
                meters=[meter],
                core=None,
                metrics=folder / "modt.prom",
                clock=lambda: faults.now_s,
            )
            self.service = service

            def tick(taken: Any) -> None:
                self.frames[taken.frame.index] = faults.now_s
                with suppress(BlockingIOError):
                    while True:
                        socket.socket.__base__.recv(notified, 65_536)  # type: ignore[union-attr]

            report = service._report

            def reported(to: Any) -> None:
                report(to)
                self._check_status()
                if source.turn >= TURNS:
                    stop.signal = "SIGTERM"

            service._report = reported  # type: ignore[method-assign]
            faults.active = True
            try:
                service.run(notifier, tick)
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
        health = self.service.recording.health()
        recording: Any = self.service.recording
        missing = recording.write.call_count + recording.ledger.call_count - sum(map(len, records.values()))
        source = self.service.source
        failed = sum(n for kind, n in self.service.failures.counts.items() if kind.startswith(("frame:", "source:")))
        left_out = source.dropped + source.faults.skipped + self.service.deadlines.shed + failed
        assert source.sweeps == self.service.totals.frames + left_out
        assert sum(health.fates.values()) == recording.write.call_count
        assert health.fates["waiting"] == 0
        for schema, numbers in records.items():
            assert len(numbers) == len({*numbers}), f"{schema} twice"
        assert missing <= health.lost_lines, f"{missing} lines are missing, {health.lost_lines} are counted"
        late = {frame for frame, at_s in self.frames.items() if at_s > self.faults.last_s + BACK_S}
        assert late <= {*records[SCHEMA]}, "frames are missing after the fault"
        if self.faults.last_s + BACK_S < self.faults.now_s - 1.0:
            assert late, "no frame after the fault"

    def _windows(self, meters: Any, *_machine: object) -> Windows:
        def monotonic_ns() -> int:
            return int(1e9 * self.faults.monotonic())

        clocks = Clocks(monotonic_ns, monotonic_ns, lambda: int(1e9 * self.faults.now_s))
        return Windows(meters, clocks, Conditions(0))

    def _check_status(self) -> None:
        """Note a status that is missing or old."""
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
