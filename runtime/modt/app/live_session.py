"""One run of a service: assembly, loop, records and status."""

from __future__ import annotations

import json
import logging
import os
import time
from collections.abc import Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Any

from modt import host, profile
from modt.app import inputs, metering
from modt.app.ladder import Ladder
from modt.app.live_loop import LiveLoop, NamedSink
from modt.app.live_stages import LiveStages
from modt.app.loop import Stop
from modt.app.parts import Parts
from modt.app.power import Power
from modt.app.prometheus import write_metrics
from modt.app.status import SCHEMA, Counts, loop_report, one_line
from modt.app.supervisor import Supervisor
from modt.energy.meters.meter import Kind
from modt.reporting.summary import Summary
from modt.sinks.job_thread import JobThread
from modt.sinks.output import LedgerSink, close_together
from modt.sinks.recording import Recording
from modt.sinks.run_directory import SUMMARY
from modt.sinks.service_directory import STATUS, ServiceDirectory
from modt.sources.live.live_stream import LiveStream
from modt.types import FrameResult

log = logging.getLogger(__name__)


class LiveSession:
    """A service over a live source.

    Args:
        request: what is asked for.
        source: open, not started.
        sinks: of the results, by their addresses.
        out: run directory.
        metrics: file for Prometheus; None for none.
        core, cores: of the loop, and of threads that serve it; None leaves them where they are.
        command: for the record.
        lacking: what the loop has to do without, for the status.

    Raises:
        MisuseError: an invalid request.
    """

    def __init__(
        self,
        request: inputs.Request,
        source: LiveStream,
        sinks: Sequence[NamedSink],
        out: Path,
        metrics: Path | None,
        core: int | None,
        cores: frozenset[int] | None,
        command: list[str],
        lacking: Sequence[str] = (),
    ) -> None:
        self.source, self.sinks, self.metrics, self.core = source, tuple(sinks), metrics, core
        self.stages = LiveStages(request, source)
        self.directory = ServiceDirectory(out)
        self.stop = Stop()
        self._cores, self._command, self._lacking = cores, command, list(lacking)
        self._summary, self.power = Summary(max_exact=0), Power()
        self._began_s = time.monotonic()
        self._counts = Counts(self._began_s)
        self._without_reflectance = 0
        self._reporting = False  # a status is being written

    def run(self, supervisor: Supervisor) -> dict[str, Any]:
        """Until a signal or the end of the source; returns the last status.

        Raises:
            ModtError: a failure that repeats, or another service that records into the same directory.
        """
        with self.directory.locked():
            return self._run(supervisor)

    def _run(self, supervisor: Supervisor) -> dict[str, Any]:
        self._followed = self.stages.parts
        config = self._followed.config
        with host.elsewhere(self._cores):
            self._writer = JobThread()
        self.recording = Recording(self.directory, config.recording, self._writer, self._description)
        energy = config.energy
        meter = metering.discovery(energy).best
        self._windows = metering.windows(meter.meters, self.core, energy.windows)
        if config.loop.power_W is not None and meter.facts is not None and meter.facts.kind is Kind.ESTIMATED:
            log.warning("loop.power_W is kept by the %s: an estimate, as no meter can be read", meter.name)
        sinks = [*self.sinks, NamedSink("recording", self.recording)]
        self.loop = LiveLoop(
            self.source,
            self.stages,
            sinks,
            self._observe,
            lambda: self._report(supervisor),
            Ladder(config.loop.power_W),
            self.stop,
            supervisor,
        )
        with ExitStack() as stack:
            stack.callback(self._finish)
            stack.callback(close_together, [named.sink for named in self.sinks])
            for part in (self.stages.odometry, self.source, supervisor):
                stack.callback(part.close)
            stack.enter_context(self.stop.on_signals(reload=True))
            self.source.start()
            self.loop.run()
        return self.status()

    def status(self) -> dict[str, Any]:
        """The document modt.status/1."""
        now_s, parts = time.monotonic(), self.stages.parts
        return {
            "schema": SCHEMA,
            "time_s": time.time(),
            "pid": os.getpid(),
            "up_s": round(now_s - self._began_s, 3),
            "source": self.source.info.name,
            "mode": parts.request.mode,
            "profile": parts.name,
            "period_s": self.stages.period_s,
            "counts": self._counts.report(now_s),
            "loop": loop_report(self.loop),
            "power": self.power.report() | {"limit_W": self.loop.ladder.power_W},
            "sensor": self.source.health()
            | {
                "faults": self.source.faults.count,
                "misfits": self.stages.misfits,
                "frames_without_reflectance": self._without_reflectance,
            },
            "odometry": self.stages.odometry.report(),
            "sinks": {named.name: named.sink.health() for named in self.sinks},
            "recording": self.recording.health(),
            "host": {"core": self.core, "resident_mb": round(host.resident_mb(), 1), "lacking": self._lacking},
        }

    def _observe(self, result: FrameResult, line: dict[str, Any]) -> None:
        if self.stages.parts is not self._followed:
            self._follow(self.stages.parts)
        self._counts.add(result)
        self._summary.add_result(result)
        self._summary.add_ledger(line)
        self._ledger(line)
        window = self._windows.add(line)
        if window is not None:
            self._ledger(window)
            watts = self.power.add(window, self._followed.config.energy)
            if watts is not None:
                self.loop.power(watts)
        misses = self.stages.parts.config.sensor.reflectance != "none" and result.proposals.reflectance is None
        self._without_reflectance += misses and len(result.proposals) > 0

    def _ledger(self, line: dict[str, Any]) -> None:
        self.recording.ledger(line)
        for named in self.sinks:
            if isinstance(named.sink, LedgerSink):
                named.sink.ledger(line)

    def _follow(self, parts: Parts) -> None:
        """Take over what a new profile says beside its stages."""
        self._followed = parts
        self.loop.ladder.power_W = parts.config.loop.power_W
        self.recording.follow(parts.config.recording)

    def _report(self, supervisor: Supervisor) -> None:
        """Say what is going on; the files are written off the loop's thread."""
        status = self.status()
        supervisor.status(one_line(status))
        if not self._reporting:
            self._reporting = self._writer.submit(lambda: self._write(status))

    def _write(self, status: dict[str, Any]) -> None:
        try:
            self.recording.sync()
            if self.recording.parts:
                self.directory.write(STATUS, json.dumps(status, indent=1) + "\n")
            if self.metrics is not None:
                write_metrics(self.metrics, status)
        finally:
            self._reporting = False

    def _description(self) -> str:
        parts, info = self.stages.parts, self.source.info
        facts = parts.facts(info, self.stages.odometry, self.core, self._command)
        return profile.to_yaml(facts | {"service": True})

    def _finish(self) -> None:
        """Write what waits, the last status and the summary."""
        self.recording.ledger(self._windows.close())
        status = self.status()
        run = _run(status) | self.stages.parts.pipeline.segmenter.facts()
        lateness = self.loop.timing.late_or_later()
        summary = self._summary.result() | {"run": run, "status": status, "lateness": lateness}
        self._writer.submit(self.recording.finish)
        self._writer.submit(lambda: self._write(status))
        text = json.dumps(summary, indent=2) + "\n"
        self._writer.submit(lambda: self.directory.write(SUMMARY, text) if self.recording.parts else None)
        self._writer.close()


def _run(status: dict[str, Any]) -> dict[str, Any]:
    names = {"source": "stream", "mode": "mode", "profile": "profile", "up_s": "elapsed_s"}
    return {new: status[old] for old, new in names.items()}
