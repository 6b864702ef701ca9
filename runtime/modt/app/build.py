"""Building of the loop of a request: a replay of a recording, or a service over a live source."""

from __future__ import annotations

import logging
import re
import secrets
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from modt import profile
from modt.app import inputs
from modt.app.deadlines import Deadlines, NoDeadlines
from modt.app.failures import Failures
from modt.app.loop import Loop, Service
from modt.app.playback import Playback
from modt.app.stages import Stages
from modt.app.stop import Stop
from modt.energy.ledger import Ledger
from modt.energy.meters.discovery import discover
from modt.energy.meters.meter import Kind
from modt.errors import MisuseError
from modt.sinks.output import Sink
from modt.sinks.recording import CLOSE_S, JOBS, AtOnce, Recording, WholeRecording, count_dropped
from modt.sinks.run_directory import RunDirectory

if TYPE_CHECKING:
    from modt.sources.live.joint_live import JointLive
    from modt.sources.live.live_stream import LiveStream

log = logging.getLogger(__name__)


def replay(
    request: inputs.Request, sinks: Mapping[str, Sink], out: Path | None, core: int | None, command: Sequence[str]
) -> Loop:
    """A replay of a recording, by default into a directory named after stream and mode; arguments as in `service`.

    Raises:
        MisuseError: an invalid request.
    """
    stop = Stop()
    ledger = Ledger()
    source = Playback(inputs.stream(request), ledger, request.rate_hz, stop.sleep)
    stages = Stages(request, source.info, ledger)
    name = re.sub(r"[^\w.]+", "-", source.info.name)
    directory = RunDirectory(out or Path("runs") / f"{name}-{request.mode}")
    if reason := directory.foreign():
        raise MisuseError(directory.path, *reason)
    recording = WholeRecording(
        directory,
        lambda: profile.to_yaml(stages.facts(core, command)),
        source.info.sequence,
        source.info.camera,
        labels=request.labels,
    )
    return Loop(
        source=source,
        stages=stages,
        recording=recording,
        sinks=sinks,
        deadlines=NoDeadlines(),
        failures=Failures(contained=False),
        stop=stop,
        meters=discover(stages.config.energy).best.meters,
        core=core,
    )


def service(
    request: inputs.Request,
    source: LiveStream | JointLive,
    sinks: Mapping[str, Sink],
    out: Path,
    metrics: Path | None,
    core: int | None,
    command: Sequence[str],
    refusals: Sequence[str] = (),
) -> Service:
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

    stages = Stages(request, source.info, Ledger(), live=True, run_id=secrets.token_hex(8))
    meter = discover(stages.config.energy).best
    if stages.config.loop.power_W is not None and meter.facts is not None and meter.facts.kind is Kind.ESTIMATED:
        log.warning("loop.power_W is kept by the %s: an estimate, as no meter can be read", meter.name)

    def describe() -> str:
        return profile.to_yaml(stages.facts(core, command) | {"service": True})

    # A disk or a file system that hangs stops one of these threads, and neither the loop nor the others.
    writer = Background("recording", AtOnce(), JOBS, on_drop=count_dropped, close_s=CLOSE_S)
    return Service(
        source=source,
        stages=stages,
        recording=Recording(RunDirectory(out), stages.config.recording, writer, describe),
        sinks=sinks,
        deadlines=Deadlines(source.info.period_s),
        failures=Failures(),
        stop=Stop(reload=True),
        meters=meter.meters,
        core=core,
        refusals=refusals,
        metrics=metrics,
        writers={name: Background(name, AtOnce(), 1) for name in ("status", "metrics")},
    )
