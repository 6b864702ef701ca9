"""The loop of a run: take the next sweep, process it, hand the result to the sinks, keep the deadline, report."""

from __future__ import annotations

import gc
import json
import logging
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from modt.app.account import Travel
from modt.app.chosen_profile import AwaitedSweep
from modt.app.deadlines import Deadlines, NoDeadlines
from modt.app.failures import RENEW_AFTER, Failures
from modt.app.playback import Playback
from modt.app.run_report import run_summary, service_status
from modt.app.stages import Stages
from modt.app.status import FrameCounter, PowerStatus, Status, one_line
from modt.app.stop import Stop
from modt.app.systemd import Notifier
from modt.app.trust_report import source_findings
from modt.energy.ledger import LedgerLine
from modt.energy.meters.meter import Conditions, Meter
from modt.energy.windows import Clocks, EnergyWindow, Windows
from modt.errors import ModtError
from modt.pipeline import SINK
from modt.reporting.summary import Summary
from modt.sinks.output import LedgerSink, Sink, StatusSink, Writer, close_together
from modt.sinks.recording import AtOnce, Job, Recording, RecordingHealth
from modt.sinks.records import fields_of
from modt.sinks.run_directory import STATUS, SUMMARY
from modt.sources.stream import Received, StreamEndedError
from modt.types import FrameResult, TrustLevel

if TYPE_CHECKING:
    from modt.sinks.background import Background
    from modt.sources.live.joint_live import JointLive
    from modt.sources.live.live_stream import LiveStream

log = logging.getLogger(__name__)

WAIT_S = 0.2
"""Longest wait for a sweep without a check of the signals and the watchdog [s]."""
RECORDING = "recording"
PROFILE = "profile"
UNLESS_BLIND = "unless_blind"
"""Value of trust.results that withholds the results from the sinks while the trust is blind."""
REPORT_S = 1.0
"""Time between two reports of the status [s]."""


@dataclass(kw_only=True, eq=False)
class Loop:
    """Drives the stages by the frames of a source. As it is, it replays a recording by a Playback.

    Service narrows the source to a live one, and adds what a robot needs.

    Attributes:
        source, stages, recording: give the frames, process them, and keep the records.
        sinks: sinks of the results, by their addresses.
        deadlines, failures, stop: decide which sweeps are processed, which failures are contained, and when to end.
        meters: meters to read.
        core: core to which the loop is pinned, None without one.
        clock: monotonic [s].
        totals: counts so far.
        power: power so far.
        travel: way of the sensor so far.
        frames_without_reflectance: number of frames without the reflectance that the profile promises.
        summary: the summary as written; empty before the end.
    """

    source: LiveStream | JointLive | Playback
    stages: Stages
    recording: Recording
    sinks: Mapping[str, Sink]
    deadlines: Deadlines | NoDeadlines
    failures: Failures
    stop: Stop
    meters: Sequence[Meter]
    core: int | None
    clock: Callable[[], float] = time.monotonic

    def __post_init__(self) -> None:
        self.totals = Summary()
        self.power = PowerStatus()
        self.frames_without_reflectance = 0
        self.travel = Travel()
        self.summary: dict[str, Any] = {}
        self._writers: dict[str, Writer[FrameResult]] = {**self.sinks, RECORDING: self.recording}
        self._ledger_sinks = [writer for writer in self._writers.values() if isinstance(writer, LedgerSink)]
        self._recorded_profile = self.stages.chosen
        self._windows = Windows(self.meters, Clocks(), Conditions(self.core or 0))
        self._began_s = self.clock()
        self._on_frame: Callable[[FrameResult], None] = lambda result: None

    @property
    def elapsed_s(self) -> float:
        """Time since the start [s]."""
        return self.clock() - self._began_s

    def run(self, notifier: Notifier, on_frame: Callable[[FrameResult], None] | None = None) -> dict[str, Any]:
        """Run until a signal or the end of the source; return the summary as written.

        Args:
            notifier: tells systemd that the run is alive.
            on_frame: called after every frame.

        Raises:
            ModtError: a failure that is not contained, or another run that records into the same directory.
        """
        self._on_frame = on_frame or self._on_frame
        with self.recording.directory.locked(), self.stop.on_signals(), ExitStack() as at_end:
            # At the end these are called last first: the last window is written, systemd is told of the end, the
            # source, the poses and the sinks are closed, and the summary is written. Then the signal handlers are
            # restored.
            self.recording.start()
            at_end.callback(self._finish)
            at_end.callback(close_together, self.sinks.values())
            for part in (self.stages.odometry, self.source, notifier):
                at_end.callback(self.failures.contain, "end", part.close)
            at_end.callback(self.failures.contain, "records", lambda: self._write_costs(self._windows.close()))
            self.source.start()
            self.process_frames(notifier)
        return self.summary

    def process_frames(self, notifier: Notifier) -> None:
        """Process frames until a signal, or the end of the source. The first one with enough points tells the sensor.

        Garbage is collected once at the start, and what is left is frozen. Later collections leave that out, so they
        are short.

        Raises:
            ModtError: a failure that cannot be contained.
        """
        gc.collect()
        gc.freeze()
        notifier.ready()
        awaited = AwaitedSweep()
        for received in self._sweeps(notifier):
            if awaited.comes_with(received.frame):
                self.failures.contain(PROFILE, self.stages.choose_profile, received.frame, self.source.profile)
                awaited.take(received.frame)
            if self.deadlines.admit(received.arrived_s):
                self._process(received)

    def _sweeps(self, notifier: Notifier) -> Iterator[Received]:
        """Sweeps as they arrive. The watchdog, reports and reloads are served between them."""
        while self.stop.signal is None:
            try:
                received = self.source.take(WAIT_S)
            except StreamEndedError:
                return
            except ModtError:
                raise
            except Exception as error:
                self.failures.fail(error, "source")
                received = None
            if received is not None:
                if self.stop.signal is not None:
                    self.deadlines.leave_out()
                    return
                yield received
            notifier.alive()
            self._serve(notifier)

    def _process(self, received: Received) -> None:
        """Process a frame. Its failure is contained: the tracks are those of the frame before.

        The time of the last frame, odometry, savings of the scheduler and class frequencies of the decision are not
        rolled back. After RENEW_AFTER failures in a row new stages begin without tracks.
        """
        try:
            line = self._step(received)
        except ModtError:
            raise
        except Exception as error:
            self.stages.ledger.close_frame(received.frame.index)
            self.failures.fail(error, "frame")
            self.failures.contain("recovery", self.stages.recover, anew=self.failures.in_a_row == RENEW_AFTER)
            return
        self.failures.succeed()
        self.deadlines.finish(received.arrived_s, line)
        self.failures.contain(PROFILE, self.stages.adapt, received.frame)

    def _step(self, received: Received) -> LedgerLine:
        """Run the stages, then the sinks, which cost no frame if they fail; returns the frame's ledger line."""
        stages = self.stages
        frame = received.frame
        budget = self.deadlines.budget(stages.budget, received.arrived_s, frame.index)
        result = stages.step(frame, budget, reduced=self.deadlines.reduced)
        blind = result.trust.level is TrustLevel.BLIND
        withheld = blind and stages.config.trust.results == UNLESS_BLIND
        for name, writer in ({RECORDING: self.recording} if withheld else self._writers).items():
            self.failures.contain(name, stages.ledger.run, SINK, writer.write, result)
        line = stages.ledger.close_frame(frame.index)
        self.failures.contain("records", self._account, result, line)
        return line

    def _account(self, result: FrameResult, line: LedgerLine) -> None:
        """Add a frame to the totals and the records, and a window that it completes to the power."""
        if self.stages.chosen is not self._recorded_profile:
            self._recorded_profile = self.stages.chosen
            self.recording.configure(self.stages.config.recording)
        config = self.stages.config
        self.totals.add_result(result)
        self.travel.add(result)
        self.totals.add_ledger(line)
        self._write_costs(line)
        window = self._windows.add(line)
        if window is not None:
            self._write_costs(window)
            self.power = self.power.after(window, config.energy)
            if self.power.watts is not None and config.loop.power_W is not None:
                self.deadlines.power(self.power.watts, config.loop.power_W)
        if config.sensor.reflectance != "none" and result.proposals.reflectance is None and len(result.proposals):
            self.frames_without_reflectance += 1
        self._on_frame(result)

    def _write_costs(self, line: LedgerLine | EnergyWindow) -> None:
        """Hand a line of the ledger to the records and to the sinks that take them."""
        for sink in self._ledger_sinks:
            sink.ledger(line)

    def _serve(self, notifier: Notifier) -> None:
        """Nothing; Service reports the status and reloads the profile."""

    def pace(self) -> dict[str, Any]:
        """Figures of the pace for the summary."""
        return {"rate_hz": self.stages.request.rate_hz}

    def _finish(self) -> None:
        """Write the summary after the queued records."""
        self.summary = run_summary(self)
        self.stages.read = self.summary["read"]
        self.failures.contain("status", self._finish_status)
        self.recording.end(self._last_documents)
        self._correct_status(self.recording.health())

    def _finish_status(self) -> None:
        """Add the last status to the summary. A replay has none."""

    def _correct_status(self, recording: RecordingHealth) -> None:
        """Correct the last status by the final counts of the records."""

    def _last_documents(self, recording: RecordingHealth) -> dict[str, str]:
        """Documents beside the records, by their names, given the final counts of these."""
        self._correct_status(recording)
        return {SUMMARY: json.dumps(self.summary, indent=2, default=fields_of) + "\n"}


@dataclass(kw_only=True, eq=False)
class Service(Loop):
    """A loop over a live source, with deadlines, a status once a second, and reloads of the profile.

    Attributes:
        refusals: refused permissions, for the status.
        metrics: file for Prometheus; None for none.
        writers: run what writes the `status` in memory and the `metrics`; others only show their health here.
        reloads, refused_reloads: number of times that the profile was loaded anew, and that it could not be used.
    """

    source: LiveStream | JointLive
    deadlines: Deadlines
    refusals: Sequence[str] = ()
    metrics: Path | None = None
    writers: dict[str, Background[Job] | Background[str] | AtOnce] = field(
        default_factory=lambda: {"status": AtOnce(), "metrics": AtOnce()}
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        self.reloads = 0
        self.refused_reloads = 0
        self._counter = FrameCounter(self.totals, self.clock())
        self._reported_s = float("-inf")
        self._health: dict[str, Any] = {}  # of the source at the last report

    def pace(self) -> dict[str, Any]:
        """Figures of the deadlines for the summary."""
        return fields_of(self.deadlines.figures())

    def status(self) -> Status:
        """The status now."""
        return service_status(self, self._counter.report(self.clock()))

    def _serve(self, notifier: Notifier) -> None:
        """Report the status once a second, and reload the profile when a signal has asked for it."""
        now_s = self.clock()
        if now_s - self._reported_s >= REPORT_S:
            self._reported_s = now_s
            self.failures.contain("status", self._report, notifier)
        if self.stop.take_reload():
            self._reload(notifier)

    def _reload(self, notifier: Notifier) -> None:
        """Take over the profile from disk. One that cannot be used is refused, and counted."""
        notifier.reloading()
        try:
            self.stages.reload()
        except Exception as error:
            self.refused_reloads += 1
            traceback = None if isinstance(error, ModtError) else error
            log.error("%s; the profile before stays in use", error, exc_info=traceback)
        else:
            self.reloads += 1
            log.warning("profile loaded again")
        notifier.ready()

    def _report(self, notifier: Notifier) -> None:
        """Judge the source, and show the status to systemd, beside the records, in memory and to Prometheus."""
        health = self.source.health()
        nominal_s = self.source.info.period_s
        self.stages.source_findings = source_findings(health, self._health, nominal_s)
        self._health = health
        self.deadlines.follow(self.source.period_s if "period" in self.stages.source_findings else nominal_s)
        status = self.status()
        notifier.status(one_line(status))
        self._write_status(status)

    def _finish_status(self) -> None:
        status = self.status()
        self.summary |= {"status": status, "lateness": self.deadlines.late_or_later()}
        self._write_status(status)
        for name in ("status", "metrics"):
            self.writers[name].close()

    def _correct_status(self, recording: RecordingHealth) -> None:
        if "status" in self.summary:
            self.summary["status"] = replace(self.summary["status"], recording=recording)

    def _last_documents(self, recording: RecordingHealth) -> dict[str, str]:
        documents = super()._last_documents(recording)
        return documents | {STATUS: _document(self.summary["status"])} if "status" in self.summary else documents

    def _write_status(self, status: Status) -> None:
        """Hand the status to a thread for each place, so that one that hangs keeps it from no other."""
        text = _document(status)
        self.recording.writer.write(lambda: self.recording.write_status(text))
        self.writers["status"].write(lambda: self.recording.keep_status(text))
        showing = [sink for sink in self.sinks.values() if isinstance(sink, StatusSink)]
        if self.metrics is None and not showing:
            return
        from modt.app.prometheus import metrics_text, write_metrics

        metrics = metrics_text(asdict(status))
        for shown in showing:
            what = f"{status.source}, profile {status.profile}, mode {status.mode}"
            shown.status(f"{what}: {one_line(status)}", metrics)
        if self.metrics is not None:
            path = self.metrics
            self.writers["metrics"].write(lambda: write_metrics(path, metrics))


def _document(status: Status) -> str:
    return json.dumps(status, indent=1, default=fields_of) + "\n"
