"""The status of a service: one document, made once a second, and its text.

Its fields are the keys of status.json (`modt.sinks.records.fields_of`).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from modt.app.deadlines import DeadlineFigures
from modt.classes import CLASS_NAMES
from modt.config import EnergyConfig
from modt.energy.attribution import attribute
from modt.energy.meters.meter import Kind
from modt.energy.windows import EnergyWindow
from modt.reporting.summary import Summary
from modt.sinks.output import Health
from modt.sinks.recording import RecordingHealth
from modt.types import NONE, Self, TrustLevel

SCHEMA = "modt.status/1"
MIN_RATE_S = 0.5
"""Shortest time over which a rate is computed [s]."""
GOOD = TrustLevel.GOOD.name.lower()
STALE_S = 5.0
"""Greatest age of the status of a running service [s]."""


@dataclass(frozen=True, kw_only=True)
class FrameCounts:
    """Frames and tracks since the start."""

    frames: int
    rate_hz: float  # since the status before
    tracks: int  # of the last frame
    visible: Mapping[str, int]  # those with a proposal in it, by class
    proposals: int
    classifications: int
    deferred: int
    left_out: Mapping[str, float]  # mean number of points of a frame without a proposal, by kind


@dataclass(frozen=True, kw_only=True)
class LoopStatus(DeadlineFigures):
    """Deadlines, failures by kind, and reloads of the profile."""

    failures: Mapping[str, int]
    reloads: int
    refused_reloads: int


@dataclass(frozen=True)
class PowerStatus:
    """Power and energy by the last window of the meters, unknown before the first one and while a meter fails."""

    watts: float | None = None
    kind: str = Kind.UNAVAILABLE
    frame_J: float | None = None  # mean of a frame
    stages_J: Mapping[str, float] = field(default_factory=dict)  # parts of it (`attribute`)
    windows: int = 0
    unread_windows: int = 0  # those without energy
    limit_W: float | None = None  # of the profile

    def after(self, window: EnergyWindow, board: EnergyConfig) -> PowerStatus:
        """The status after another window."""
        frames = window.n_frames
        parts_J = attribute(window, board) if frames else {}
        return PowerStatus(
            watts=window.watts,
            kind=window.kind,
            frame_J=window.frame_J,
            stages_J={stage: round(part_J / frames, 6) for stage, part_J in parts_J.items()},
            windows=self.windows + 1,
            unread_windows=self.unread_windows + (window.energy_J is None),
        )


@dataclass(frozen=True)
class HostStatus:
    """The process on its machine."""

    core: int | None  # to which the loop is pinned
    resident_mb: float | None
    lacking: Sequence[str]  # permissions that were refused


@dataclass(frozen=True, kw_only=True)
class Status:
    """The document modt.status/1."""

    schema: str = SCHEMA
    run: str  # as FrameResult.run_id
    time_s: float
    pid: int
    up_s: float
    source: str
    mode: str
    profile: str
    period_s: float
    trust: Mapping[str, Any] = field(default_factory=dict)  # level, since when, reasons, and frames of each level
    counts: FrameCounts
    loop: LoopStatus
    power: PowerStatus
    sensor: Mapping[str, Any]  # health of the source, faults, misfits and frames without reflectance
    odometry: Mapping[str, Any]  # report of the source of the poses
    sinks: Mapping[str, Health]
    recording: RecordingHealth
    host: HostStatus

    @classmethod
    def of(cls, record: Mapping[str, Any]) -> Self:
        """The status in a file. Raises one of modt.sinks.records.BROKEN."""
        kinds = {
            "counts": FrameCounts,
            "loop": LoopStatus,
            "power": PowerStatus,
            "recording": RecordingHealth,
            "host": HostStatus,
        }
        parts = {name: kind(**record[name]) for name, kind in kinds.items()}
        return cls(**{**record, **parts})


class FrameCounter:
    """Counts the frames of a run, and their rate since the last report.

    Args:
        totals: counts of the run.
        now_s: time of its start.
    """

    def __init__(self, totals: Summary, now_s: float) -> None:
        self._totals = totals
        self._rate_hz = 0.0
        # Frames and time when the rate was last computed
        self._frames = 0
        self._since_s = now_s

    def report(self, now_s: float) -> FrameCounts:
        """Counts so far."""
        totals = self._totals
        seconds = now_s - self._since_s
        if seconds >= MIN_RATE_S:
            self._rate_hz = (totals.frames - self._frames) / seconds
            self._frames = totals.frames
            self._since_s = now_s
        tracks = totals.tracks
        seen = tracks.object_class[tracks.proposal != NONE]
        by_class = np.bincount(seen, minlength=len(CLASS_NAMES)).tolist()
        return FrameCounts(
            frames=totals.frames,
            rate_hz=round(self._rate_hz, 2),
            tracks=len(tracks),
            visible=dict(zip(CLASS_NAMES, by_class, strict=True)),
            proposals=totals.proposals,
            classifications=totals.classified,
            deferred=totals.deferred,
            left_out=totals.left_out,
        )


def one_line(status: Status) -> str:
    """Rate, tracks and watts, as systemd shows them."""
    counts = status.counts
    power = status.power
    classes = ", ".join(f"{n} {name}" for name, n in counts.visible.items() if n and name != CLASS_NAMES[0])
    watts = "power unknown" if power.watts is None else f"{power.watts:.1f} W {power.kind}"
    step = "" if status.loop.step == "all" else f", load: {status.loop.step}"
    silent = ", sensor silent" if status.sensor.get("silent") else ""
    seen = f" ({classes})" if classes else ""
    level = status.trust.get("level", GOOD)
    trust = "" if level == GOOD else f", {level}"
    return f"{counts.rate_hz:.1f} Hz, {counts.tracks} tracks{seen}, {watts}{step}{silent}{trust}"


def status_text(status: Status, now_s: float) -> str:
    """Lines for a terminal, without control characters."""
    loop = status.loop
    power = status.power
    recording = status.recording
    age_s = now_s - status.time_s
    running = f"running for {status.up_s:.0f} s"
    state = running if age_s < STALE_S else f"NOT running: last heard of {age_s:.0f} s ago"
    entered = ", ".join(f"{step} {n} times" for step, n in loop.steps_entered.items())
    energy = "unavailable" if power.frame_J is None else f"{1e3 * power.frame_J:.0f} mJ a frame, {power.kind}"
    left_out = ", ".join(f"{kind} {mean:.0f}" for kind, mean in status.counts.left_out.items() if mean)
    stages = ", ".join(f"{stage} {1e3 * joules:.1f}" for stage, joules in power.stages_J.items() if joules)
    lines = [
        f"{status.source}: {state}, mode {status.mode}, profile {status.profile}",
        f"  {one_line(status)}",
        f"  trust       {_trust(status.trust)}",
        f"  deadlines   {loop.missed_deadlines} of {loop.frames} missed, {loop.shed_sweeps} sweeps left out",
        f"  lateness    {_times(loop.lateness_ms)}",
        f"  execution   {_times(loop.execution_ms)}",
        f"  latency     {_times(loop.latency_ms)}",
        f"  budget      {loop.budget_ms:.1f} ms for classification, {loop.other_stages_ms:.1f} ms for the rest",
        f"  load        {loop.step}" + (f" ({entered})" if entered else ""),
        f"  energy      {energy}",
        *([f"  by stage    {stages} mJ a frame, estimated"] if stages else []),
        *([f"  left out    {left_out.replace('_', ' ')} points a frame"] if left_out else []),
        f"  sensor      {_counts(status.sensor)}",
        f"  recording   {recording.failing or 'on'}, {recording.lines} lines, {recording.lost_lines} lost",
        *(f"  sink        {name}: {_counts(health)}" for name, health in status.sinks.items()),
        *(f"  failures    {kind}: {n}" for kind, n in loop.failures.items()),
        *(f"  warning     {refusal}" for refusal in status.host.lacking),
    ]
    return "\n".join("".join(c if c.isprintable() else "?" for c in line) for line in lines)


def _trust(trust: Mapping[str, Any]) -> str:
    """Level, and the causes of one that is not good."""
    causes = "; ".join(reason["cause"] for reason in trust.get("reasons", ()))
    return f"{trust.get('level', GOOD)}" + (f": {causes}" if causes else "")


def _times(figures: Mapping[str, float]) -> str:
    return ", ".join(f"{name} {ms:.1f}" for name, ms in figures.items()) + " ms"


def _counts(health: Mapping[str, Any]) -> str:
    """Scalars that are not empty or zero."""
    shown = {key: value for key, value in health.items() if value and not isinstance(value, dict)}
    return ", ".join(f"{key.replace('_', ' ')} {value}" for key, value in shown.items()) or "nothing to report"
