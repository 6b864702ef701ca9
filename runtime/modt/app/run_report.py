"""The status of a service and the summary of a run, which are written beside its frames."""

from __future__ import annotations

import os
import time
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from modt import host
from modt.app.account import account
from modt.app.status import FrameCounts, HostStatus, LoopStatus, Status
from modt.classes import CLASS_NAMES
from modt.sinks.records import fields_of

if TYPE_CHECKING:
    from modt.app.loop import Loop, Service


def service_status(service: Service, counts: FrameCounts) -> Status:
    """The status of a service."""
    stages = service.stages
    failures = service.failures
    return Status(
        run=stages.run_id,
        time_s=time.time(),
        pid=os.getpid(),
        up_s=round(service.elapsed_s, 3),
        source=stages.info.name,
        mode=stages.request.mode,
        profile=stages.chosen.name,
        period_s=stages.info.period_s,
        trust=stages.trust.record(silent=bool(service.source.health()["silent"])),
        counts=counts,
        loop=LoopStatus(
            **fields_of(service.deadlines.figures()),
            failures=dict(failures.counts),
            reloads=service.reloads,
            refused_reloads=service.refused_reloads,
        ),
        power=replace(service.power, limit_W=stages.config.loop.power_W),
        sensor=service.source.health()
        | {"faults": service.source.faults.count, "misfits": stages.misfits}
        | {"frames_without_reflectance": service.frames_without_reflectance},
        odometry=stages.odometry.report(),
        sinks={name: writer.health() for name, writer in {**service.sinks, **service.writers}.items()},
        recording=service.recording.health(),
        host=HostStatus(
            core=service.core,
            resident_mb=failures.contain("host", lambda: round(host.resident_mb(), 1)),
            lacking=service.refusals,
        ),
    )


def run_summary(loop: Loop) -> dict[str, Any]:
    """The summary of a run, modt.summary/1."""
    stages = loop.stages
    pipeline = stages.pipeline
    faults = loop.source.faults
    frames = loop.totals.frames
    elapsed_s = loop.elapsed_s
    return loop.totals.result() | {
        "run": {
            "stream": stages.info.name,
            "mode": stages.request.mode,
            "fov": stages.request.fov,
            "profile": stages.chosen.name,
            **pipeline.view.facts(),
            "elapsed_s": elapsed_s,
            "frames_per_s": frames / elapsed_s,
            "real_time_factor": frames * stages.info.period_s / elapsed_s,
            "stopped_by": loop.stop.signal,
            **loop.pace(),
        },
        "trust": stages.trust.record(),
        "read": account(loop),
        "odometry": stages.odometry.report(),
        "class_frequency": dict(zip(CLASS_NAMES, pipeline.decision.frequency.tolist(), strict=True)),
        "host": loop.failures.contain("host", host.usage, loop.core),
        "sinks": {address: sink.health() for address, sink in loop.sinks.items()},
        "faults": {
            "count": faults.count,
            "skipped": faults.skipped,
            "first": next((f"{f.subject}: {f.cause}" for f in faults.first), None),
            "frames_without_reflectance": loop.frames_without_reflectance,
        },
    }
