"""One run: a service over a live source, or a replay, which is a run without deadlines."""

from __future__ import annotations

import gc
import json
import logging
import os
import re
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, Any

from modt import host, profile
from modt.app import inputs
from modt.app.containment import RENEW_AFTER, Containment
from modt.app.deadlines import Deadlines, NoDeadlines
from modt.app.playback import Playback
from modt.app.stages import SensorWatch, Stages
from modt.app.status import SCHEMA, Counts, Power, one_line
from modt.app.stop import Stop
from modt.app.supervisor import Supervisor
from modt.classes import CLASS_NAMES
from modt.energy.ledger import Ledger, Line
from modt.energy.meters.discovery import discover
from modt.energy.meters.meter import Conditions, Kind, Meter
from modt.energy.windows import Clocks, Windows
from modt.errors import ModtError
from modt.pipeline import SINK
from modt.reporting.summary import Summary
from modt.sinks.output import LedgerSink, Sink, close_together
from modt.sinks.recording import CLOSE_S, JOBS, AtOnce, Recording, WholeRecording
from modt.sinks.run_directory import SUMMARY, RunDirectory
from modt.sources.stream import Received, StreamEndedError
from modt.types import FrameResult

if TYPE_CHECKING:
    from modt.sources.live.live_stream import LiveStream

log = logging.getLogger(__name__)

WAIT_S = 0.2
"""Longest wait for a sweep without a check of the signals and the watchdog [s]."""
REPORT_S = 1.0
"""Time between two reports of the status [s]."""
Tick = Callable[[FrameResult], None]
"""Called after every frame."""


class Session:
    """A run, put together by `replay` or `service`: drives the stages by the frames of a source.

    Attributes:
        source, stages, recording: give the frames, process them, and keep the records.
        sinks: sinks of the results, by their addresses.
        deadlines, failures, stop: decide which sweeps are processed, which failures are contained, and when to end.
        power: power by the windows of the meters.
        summary: the summary as written; empty before the end.
    """

    def __init__(
        self,
        source: LiveStream | Playback,
        stages: Stages,
        recording: Recording,
        sinks: Mapping[str, Sink],
        deadlines: Deadlines | NoDeadlines,
        failures: Containment,
        stop: Stop,
        meters: Sequence[Meter],
        core: int | None,
        refusals: Sequence[str] = (),
        metrics: Path | None = None,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._clock = clock
        self.source, self.stages, self.recording, self.sinks = source, stages, recording, sinks
        self.deadlines, self.failures, self.stop = deadlines, failures, stop
        self._totals, self._core, self._refusals, self._metrics = Summary(), core, list(refusals), metrics
        self._outputs = {**sinks, "recording": recording}
        self._ledgers = [sink for sink in self._outputs.values() if isinstance(sink, LedgerSink)]
        self._followed = stages.chosen
        self.power, self.summary = Power(), dict[str, Any]()
        self._windows = Windows(meters, Clocks(), Conditions(core or 0))
        self._began_s = clock()
        self._counts = Counts(self._totals, self._began_s)
        self._reloads = self._refused_reloads = 0
        self._without_reflectance = 0
        self._tick: Tick = lambda result: None

    def run(self, supervisor: Supervisor, tick: Tick | None = None) -> dict[str, Any]:
        """Run until a signal or the end of the source; return the summary as written.

        Raises:
            ModtError: a failure that is not contained, or another run that records into the same directory.
        """
        self._tick = tick or self._tick
        with self.recording.directory.locked(), ExitStack() as stack:
            self.recording.start()
            stack.callback(self._finish)
            stack.callback(close_together, self.sinks.values())
            for part in (self.stages.odometry, self.source, supervisor):
                stack.callback(self.failures.contain, "end", part.close)
            stack.callback(self.failures.contain, "records", lambda: self._ledger(self._windows.close()))
            stack.enter_context(self.stop.on_signals())
            self.source.start()
            self.follow(supervisor)
        return self.summary

    def follow(self, supervisor: Supervisor) -> None:
        """Process frames until a signal, or the end of the source. The first one identifies the sensor.

        Garbage is collected and frozen once at the start, so that no full collection falls into a frame.

        Raises:
            ModtError: a failure that cannot be contained.
        """
        gc.collect()
        gc.freeze()
        supervisor.ready()
        frames = self._frames(supervisor)
        first = next(frames, None)
        if first is not None:
            self.stages.recognise(first.frame, self.source.profile)
            for received in chain([first], frames):
                self._process(received)

    def _frames(self, supervisor: Supervisor) -> Iterator[Received]:
        """Frames as they arrive. Reloads, watchdog and reports are served between them."""
        reported_s = float("-inf")
        while self.stop.signal is None:
            if self.stop.take_reload():
                self._reload(supervisor)
            try:
                received = self.source.take(WAIT_S)
            except StreamEndedError:
                return
            except ModtError:
                raise
            except Exception as error:
                self.failures.fail(error, "source")
                received = None
            if received is not None and self.stop.signal is None:
                yield received
            supervisor.alive()
            if self._clock() - reported_s >= REPORT_S:
                reported_s = self._clock()
                self.failures.contain("status", self._report, supervisor)

    def _process(self, received: Received) -> None:
        if not self.deadlines.admit(received.arrived_s):
            return
        try:
            line = self._step(received)
        except ModtError:
            raise
        except Exception as error:
            self.stages.ledger.close_frame(received.frame.index)
            self.failures.fail(error, "frame")
            self.stages.recover(anew=self.failures.in_a_row == RENEW_AFTER)
            return
        self.failures.succeed()
        self.deadlines.finish(received.arrived_s, line)
        self.stages.watch(received.frame)

    def _step(self, received: Received) -> Line:
        """Process a frame; returns its ledger line."""
        stages, frame = self.stages, received.frame
        budget = self.deadlines.budget(stages.budget, received.arrived_s, frame.index)
        result = stages.step(frame, budget, reduced=self.deadlines.reduced)
        for name, sink in self._outputs.items():
            self.failures.contain(name, stages.ledger.run, SINK, sink.write, result)
        line = stages.ledger.close_frame(frame.index)
        self.failures.contain("records", self._observe, result, line)
        return line

    def _reload(self, supervisor: Supervisor) -> None:
        supervisor.reloading()
        try:
            self.stages.reload()
        except ModtError as error:
            self._refused_reloads += 1
            log.error("%s; the profile before stays in use", error)
        else:
            self._reloads += 1
            log.warning("profile loaded again")
        supervisor.ready()

    def status(self) -> dict[str, Any]:
        """The document modt.status/1."""
        now_s, info = self._clock(), self.stages.info
        resident_mb = self.failures.contain("host", lambda: round(host.resident_mb(), 1))
        reloads = {"reloads": self._reloads, "refused_reloads": self._refused_reloads}
        return {
            "schema": SCHEMA,
            "time_s": time.time(),
            "pid": os.getpid(),
            "up_s": round(now_s - self._began_s, 3),
            "source": info.name,
            "mode": self.stages.request.mode,
            "profile": self.stages.chosen.name,
            "period_s": info.period_s,
            "counts": self._counts.report(now_s),
            "loop": self.deadlines.report() | {"failures": dict(self.failures.counts)} | reloads,
            "power": self.power.report() | {"limit_W": self.stages.config.loop.power_W},
            "sensor": self.source.health()
            | {"faults": self.source.faults.count, "misfits": self.stages.misfits}
            | {"frames_without_reflectance": self._without_reflectance},
            "odometry": self.stages.odometry.report(),
            "sinks": self._sinks_health(),
            "recording": self.recording.health(),
            "host": {"core": self._core, "resident_mb": resident_mb, "lacking": self._refusals},
        }

    def _report(self, supervisor: Supervisor) -> None:
        """Show the status of a service to its supervisor, in status.json and to Prometheus."""
        if isinstance(self.deadlines, Deadlines):
            status = self.status()
            supervisor.status(one_line(status))
            self.recording.writer.write(lambda: self._show(status))

    def _show(self, status: dict[str, Any]) -> None:
        self.recording.state(json.dumps(status, indent=1) + "\n")
        if self._metrics is not None:
            from modt.app.prometheus import write_metrics

            write_metrics(self._metrics, status)

    def _observe(self, result: FrameResult, line: Line) -> None:
        if self.stages.chosen is not self._followed:
            self._followed = self.stages.chosen
            self.recording.follow(self._followed.config.recording)
        config = self._followed.config
        self._totals.add_result(result)
        self._totals.add_ledger(line)
        self._ledger(line)
        window = self._windows.add(line)
        if window is not None:
            self._ledger(window)
            watts, limit_W = self.power.add(window, config.energy), config.loop.power_W
            if watts is not None and limit_W is not None:
                self.deadlines.power(watts, limit_W)
        misses = config.sensor.reflectance != "none" and result.proposals.reflectance is None
        self._without_reflectance += misses and len(result.proposals) > 0
        self._tick(result)

    def _ledger(self, line: Line) -> None:
        for sink in self._ledgers:
            sink.ledger(line)

    def _sinks_health(self) -> dict[str, Any]:
        return {address: sink.health() for address, sink in self.sinks.items()}

    def _finish(self) -> None:
        """Write the summary after the queued records."""
        elapsed_s, frames, stages = self._clock() - self._began_s, self._totals.frames, self.stages
        faults = self.source.faults
        self.summary = self._totals.result() | {
            "run": {
                "stream": stages.info.name,
                "mode": stages.request.mode,
                "fov": stages.request.fov,
                "profile": stages.chosen.name,
                **stages.pipeline.segmenter.facts(),
                "elapsed_s": elapsed_s,
                "frames_per_s": frames / elapsed_s,
                "real_time_factor": frames * stages.info.period_s / elapsed_s,
                "stopped_by": self.stop.signal,
                **self.deadlines.report(),
            },
            "odometry": stages.odometry.report(),
            "class_frequency": dict(zip(CLASS_NAMES, stages.pipeline.decision.frequency.tolist(), strict=True)),
            "host": self.failures.contain("host", host.usage, self._core),
            "sinks": self._sinks_health(),
            "faults": {
                "count": faults.count,
                "skipped": faults.skipped,
                "first": next((f"{f.subject}: {f.cause}" for f in faults.first), None),
                "frames_without_reflectance": self._without_reflectance,
            },
        }
        directory, writer = self.recording.directory, self.recording.writer
        if isinstance(self.deadlines, Deadlines):
            last = self.status()
            self.summary |= {"status": last, "lateness": self.deadlines.late_or_later()}
            writer.write(lambda: self._show(last))
        writer.write(self.recording.finish)
        text = json.dumps(self.summary, indent=2) + "\n"
        writer.write(lambda: directory.write(SUMMARY, text) if self.recording.parts else None)
        writer.close()


def replay(
    request: inputs.Request, sinks: Mapping[str, Sink], out: Path | None, core: int | None, command: Sequence[str]
) -> Session:
    """A replay of a recording, by default into a directory named after stream and mode; arguments as in `service`.

    Raises:
        MisuseError: an invalid request.
    """
    stop, ledger = Stop(), Ledger()
    source = Playback(inputs.stream(request), ledger, request.rate_hz, stop.sleep)
    stages = Stages(request, source.info, ledger)
    name = re.sub(r"[^\w.]+", "-", source.info.name)
    recording = WholeRecording(
        RunDirectory(out or Path("runs") / f"{name}-{request.mode}"),
        lambda: profile.to_yaml(stages.facts(core, command)),
        source.info.sequence,
        source.info.camera,
        labels=request.labels,
    )
    meters = discover(stages.config.energy).best.meters
    deadlines, failures = NoDeadlines(request.rate_hz), Containment(contains=False)
    return Session(source, stages, recording, sinks, deadlines, failures, stop, meters, core)


def service(
    request: inputs.Request,
    source: LiveStream,
    sinks: Mapping[str, Sink],
    out: Path,
    metrics: Path | None,
    core: int | None,
    command: Sequence[str],
    refusals: Sequence[str] = (),
) -> Session:
    """A service over a live source. Threads that write start on the cores that the calling thread may use.

    Args:
        request: the options of the user.
        source: open, not started.
        sinks: sinks of the results, by their addresses.
        out: run directory.
        metrics: file for Prometheus; None for none.
        core: core of the loop; None leaves the affinity unchanged.
        command: for the record.
        refusals: refused permissions, for the status.

    Raises:
        MisuseError: an invalid request.
    """
    from modt.sinks.background import Background

    stages = Stages(request, source.info, Ledger(), SensorWatch())
    meter = discover(stages.config.energy).best
    if stages.config.loop.power_W is not None and meter.facts is not None and meter.facts.kind is Kind.ESTIMATED:
        log.warning("loop.power_W is kept by the %s: an estimate, as no meter can be read", meter.name)

    def describe() -> str:
        return profile.to_yaml(stages.facts(core, command) | {"service": True})

    writer = Background("recording", AtOnce(), JOBS, close_s=CLOSE_S)
    recording = Recording(RunDirectory(out), stages.config.recording, writer, describe)
    deadlines, failures, stop = Deadlines(source.info.period_s), Containment(), Stop(reload=True)
    meters = meter.meters
    return Session(source, stages, recording, sinks, deadlines, failures, stop, meters, core, refusals, metrics)
