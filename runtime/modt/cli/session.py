"""One replay from its first to its last file."""

from __future__ import annotations

import re
import time
from contextlib import ExitStack
from pathlib import Path
from typing import Any

from modt import assembly, host, profile
from modt.cli import assemble, metering
from modt.cli.progress import Tick
from modt.energy.ledger import Ledger
from modt.loop import FixedPeriod, FullSpeed, Pace, Stop, drive
from modt.reporting.summary import Summary
from modt.sinks.kitti import KittiResults
from modt.sinks.labels import PointLabels
from modt.sinks.run_directory import RunDirectory
from modt.sinks.sink import Sink
from modt.sources.pose_source import PosedStream
from modt.supervisor import Supervisor
from modt.types import FrameResult, Proposals

HELPER_SHARE = 0.01
"""CPU time of other threads, as a share of the loop's, up to which the process counts as single-threaded."""


class Session:
    """Puts a replay together, runs it, and leaves a run directory behind.

    Args:
        request: what was asked for.
        out: the run directory, None for one named after stream and mode.
        core: the core that the process is confined to, None for any.
        command: as it was typed.

    Raises:
        MisuseError: a part of the request cannot be met.
        ModtError: the run directory cannot be written.
    """

    def __init__(self, request: assemble.Request, out: Path | None, core: int | None, command: list[str]) -> None:
        self.request, self.core = request, core
        self.profile = profile.load(request.profile)
        self.mode = assembly.MODES[request.mode]
        found = assemble.stream(request)
        self.odometry = assemble.odometry(request, found, self.profile.odometry)
        self.stream = PosedStream(found, self.odometry)
        self.pipeline = assembly.pipeline(
            self.mode, self.profile, assemble.field_of_view(request, self.stream), Ledger()
        )
        self.stop = Stop()
        self.pace: Pace = FullSpeed() if request.rate_hz is None else FixedPeriod(1.0 / request.rate_hz)
        self._frames_without_reflectance = 0
        self.directory = RunDirectory(out or Path("runs") / f"{self._stream_name()}-{request.mode}")
        self._describe(command)

    @property
    def notes(self) -> list[str]:
        """What a user should know before it starts."""
        kept = [f"an earlier run is kept as {self.directory.kept}"] if self.directory.kept else []
        return [*self._missing, *kept]

    @property
    def _missing(self) -> list[str]:
        return [*self.stream.info.notes, *self.stream.info.pose_notes]

    def run(self, tick: Tick, supervisor: Supervisor) -> dict[str, Any]:
        """Drive the stream through; returns the summary that was written."""
        summary = Summary()
        ledger_lines = self.directory.ledger()
        sinks: list[Sink] = [self.directory.tracks(), *self._further_sinks()]
        windows = metering.windows(self.profile.energy, self.core)

        def observe(result: FrameResult, ledger_line: dict[str, Any]) -> None:
            summary.add_result(result)
            summary.add_ledger(ledger_line)
            self._frames_without_reflectance += self._lacks_reflectance(result.proposals)
            window = windows.add(ledger_line)
            if window is not None:
                ledger_lines.write(window)
            supervisor.frame_done()
            tick(result)

        budget = self.mode.budget(self.profile)
        began_s = time.monotonic()
        with ExitStack() as stack:
            stack.callback(self.odometry.close)
            stack.callback(ledger_lines.close)
            for sink in sinks:
                stack.callback(sink.close)
            stack.callback(supervisor.close)
            stack.enter_context(self.stop.on_signals())
            drive(self.stream, self.pipeline, sinks, ledger_lines, budget, self.pace, self.stop, observe)
            ledger_lines.write(windows.close())
        elapsed_s = time.monotonic() - began_s
        figures = summary.result() | self._circumstances(summary.frames, elapsed_s)
        self.directory.summarise(figures)
        return figures

    def _lacks_reflectance(self, proposals: Proposals) -> bool:
        """Whether they tell no reflectance, though the profile says that the sensor records it."""
        return self.profile.sensor.reflectance != "none" and len(proposals) > 0 and proposals.reflectance is None

    def _further_sinks(self) -> list[Sink]:
        info, path = self.stream.info, self.directory.path
        labels: list[Sink] = [PointLabels(path / "labels")] if self.request.labels else []
        return [KittiResults(path / "kitti" / f"{info.sequence:04d}.txt", info.camera), *labels]

    def _stream_name(self) -> str:
        return re.sub(r"[^\w.]+", "-", self.stream.info.name)

    def _describe(self, command: list[str]) -> None:
        info = self.stream.info
        facts = {
            "schema": "modt.run/1",
            "command": command,
            "stream": {
                "name": info.name,
                "layout": info.layout,
                "path": str(self.request.path.resolve()) if self.request.path else None,
                "frames": info.n_frames,
                "poses": info.has_poses,
                "odometry": self.odometry.report()["source"],
                "notes": self._missing,
            },
            "mode": self.request.mode,
            "fov": self.request.fov,
            "core": self.core,
            "versions": host.versions(),
            "model": self.pipeline.classifier.facts(),
            "host": host.description(),
            "profile": profile.dump(self.profile),
        }
        self.directory.describe(profile.to_yaml(facts))

    def _circumstances(self, frames: int, elapsed_s: float) -> dict[str, Any]:
        """What the figures were taken under."""
        threads, faults = host.thread_report(), self.stream.faults
        idle_beside = threads.others_cpu_s <= HELPER_SHARE * threads.main_cpu_s
        one_core = self.core is not None and threads.cores == (self.core,) and idle_beside
        return {
            "run": {
                "stream": self.stream.info.name,
                "mode": self.request.mode,
                "fov": self.request.fov,
                "elapsed_s": elapsed_s,
                "frames_per_s": frames / elapsed_s,
                "real_time_factor": frames * self.stream.info.period_s / elapsed_s,
                "stopped_by": self.stop.signal,
                **self.pace.report(),
            },
            "odometry": self.odometry.report(),
            "host": {
                "core": self.core,
                "one_core_verified": one_core,
                "threads": threads.threads,
                "other_threads_cpu_s": threads.others_cpu_s,
                "peak_rss_mb": host.peak_rss_mb(),
            },
            "faults": {
                "count": faults.count,
                "skipped": faults.skipped,
                "first": next((f"{f.subject}: {f.cause}" for f in faults.first), None),
                "frames_without_reflectance": self._frames_without_reflectance,
            },
        }
