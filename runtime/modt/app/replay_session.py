"""One replay: assembly, run, and run directory."""

from __future__ import annotations

import re
import time
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path
from typing import Any

from modt import host, profile
from modt.app import inputs, metering
from modt.app.chosen_profile import choose
from modt.app.loop import FixedPeriod, FullSpeed, Pace, Stop, drive
from modt.app.parts import Parts, pipeline_of
from modt.app.supervisor import Supervisor
from modt.energy.ledger import Ledger
from modt.reporting.summary import Summary
from modt.schemes import open_sink
from modt.sinks.kitti import KittiResults
from modt.sinks.labels import PointLabels
from modt.sinks.output import LedgerLines, Sink, close_together
from modt.sinks.run_directory import RunDirectory
from modt.sources.pose_source import PosedStream
from modt.sources.stream import PeekedStream
from modt.types import FrameResult, Proposals

Tick = Callable[[FrameResult], None]
"""Called after every frame."""


class Session:
    """A replay and its run directory, by default named after stream and mode.

    Raises:
        MisuseError: an invalid request.
        ModtError: the run directory cannot be written.
    """

    def __init__(self, request: inputs.Request, out: Path | None, core: int | None, command: list[str]) -> None:
        self.request, self.core = request, core
        found = PeekedStream(inputs.stream(request))
        chosen = choose(request.profile, found.first, found.info)
        self.odometry = inputs.odometry(request, found, chosen.config.odometry)
        self.stream = PosedStream(found, self.odometry)
        self.parts = Parts(request, chosen, pipeline_of(request, self.stream, chosen.config, Ledger()))
        self.stop = Stop()
        self.pace: Pace = (
            FullSpeed() if request.rate_hz is None else FixedPeriod(1.0 / request.rate_hz, sleep=self.stop.sleep)
        )
        self._frames_without_reflectance = 0
        self.sinks = {address: open_sink(address) for address in dict.fromkeys(request.sink)}
        stream_name = re.sub(r"[^\w.]+", "-", self.stream.info.name)
        self.directory = RunDirectory(out or Path("runs") / f"{stream_name}-{request.mode}")
        facts = self.parts.facts(self.stream.info, self.odometry, core, command)
        self.directory.describe(profile.to_yaml(facts))

    @property
    def notes(self) -> list[str]:
        """Notes for the user before the start."""
        kept = [f"an earlier run is kept as {self.directory.kept}"] if self.directory.kept else []
        return [*self.stream.info.notes, *self.stream.info.pose_notes, *kept]

    def run(self, tick: Tick, supervisor: Supervisor) -> dict[str, Any]:
        """Process the stream; returns the summary, as written."""
        summary = Summary()
        recorded = self._sinks()
        sinks = [*recorded, *self.sinks.values()]
        ledger_lines = LedgerLines(self.directory.ledger(), sinks)
        energy = self.parts.config.energy
        windows = metering.windows(metering.discovery(energy).best.meters, self.core, energy.windows)

        def observe(result: FrameResult, ledger_line: dict[str, Any]) -> None:
            summary.add_result(result)
            summary.add_ledger(ledger_line)
            self._frames_without_reflectance += self._misses_reflectance(result.proposals)
            window = windows.add(ledger_line)
            if window is not None:
                ledger_lines.write(window)
            supervisor.frame_done()
            tick(result)

        began_s = time.monotonic()
        with ExitStack() as stack:
            stack.callback(close_together, self.sinks.values())
            for part in (self.odometry, ledger_lines, *recorded, supervisor):
                stack.callback(part.close)
            stack.enter_context(self.stop.on_signals())
            pipeline, budget = self.parts.pipeline, self.parts.budget
            drive(self.stream, pipeline, sinks, ledger_lines, budget, self.pace, self.stop, observe)
            ledger_lines.write(windows.close())
        elapsed_s = time.monotonic() - began_s
        figures = summary.result() | self._environment(summary.frames, elapsed_s)
        self.directory.summarise(figures)
        return figures

    def _misses_reflectance(self, proposals: Proposals) -> bool:
        """Whether they lack reflectance, though the sensor of the profile records it."""
        return self.parts.config.sensor.reflectance != "none" and len(proposals) > 0 and proposals.reflectance is None

    def _sinks(self) -> list[Sink]:
        info, path = self.stream.info, self.directory.path
        camera = None if info.camera is None else self.parts.pipeline.mount.camera(info.camera)
        kitti = KittiResults(path / "kitti" / f"{info.sequence:04d}.txt", camera)
        labels: list[Sink] = [PointLabels(path / "labels")] if self.request.labels else []
        return [self.directory.tracks(), kitti, *labels]

    def _environment(self, frames: int, elapsed_s: float) -> dict[str, Any]:
        """Timing, pose source, host and faults of the run."""
        faults = self.stream.faults
        return {
            "run": {
                "stream": self.stream.info.name,
                "mode": self.request.mode,
                "fov": self.request.fov,
                "profile": self.parts.name,
                **self.parts.pipeline.segmenter.facts(),
                "elapsed_s": elapsed_s,
                "frames_per_s": frames / elapsed_s,
                "real_time_factor": frames * self.stream.info.period_s / elapsed_s,
                "stopped_by": self.stop.signal,
                **self.pace.report(),
            },
            "odometry": self.odometry.report(),
            "class_frequency": self.parts.class_frequency(),
            "host": host.usage(self.core),
            "sinks": {address: sink.health() for address, sink in self.sinks.items()},
            "faults": {
                "count": faults.count,
                "skipped": faults.skipped,
                "first": next((f"{f.subject}: {f.cause}" for f in faults.first), None),
                "frames_without_reflectance": self._frames_without_reflectance,
            },
        }
