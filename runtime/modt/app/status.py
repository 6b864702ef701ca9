"""The status of a service: one JSON document, made once a second."""

from __future__ import annotations

from typing import Any

import numpy as np

from modt.classes import CLASS_NAMES
from modt.config import EnergyConfig
from modt.energy.attribution import attribute
from modt.reporting.summary import Summary
from modt.types import NONE

SCHEMA = "modt.status/1"
MIN_RATE_S = 0.5
"""Shortest time over which a rate is computed [s]."""
STALE_S = 5.0
"""Greatest age of the status of a running service [s]."""


class Counts:
    """Frames and tracks since the start, and their rate.

    Args:
        totals: counts of the run.
        now_s: time of the start.
    """

    def __init__(self, totals: Summary, now_s: float) -> None:
        self._totals, self._rate_hz = totals, 0.0
        self._frames, self._since_s = 0, now_s  # when the rate was last computed

    def report(self, now_s: float) -> dict[str, Any]:
        """Figures for the status, with the tracks of the last frame. The rate is the one since the last report."""
        totals, tracks, seconds = self._totals, self._totals.tracks, now_s - self._since_s
        if seconds >= MIN_RATE_S:
            self._rate_hz = (totals.frames - self._frames) / seconds
            self._frames, self._since_s = totals.frames, now_s
        seen = tracks.object_class[tracks.proposal != NONE]
        return {
            "frames": totals.frames,
            "rate_hz": round(self._rate_hz, 2),
            "tracks": len(tracks),
            "visible": dict(zip(CLASS_NAMES, np.bincount(seen, minlength=len(CLASS_NAMES)).tolist(), strict=True)),
            "proposals": totals.proposals,
            "classifications": totals.classified,
            "deferred": totals.deferred,
        }


class Power:
    """Power by the windows of the meters. It is unknown before the first reading and while the meters fail.

    Attributes:
        windows, unread: number of all windows, and of those without energy.
    """

    def __init__(self) -> None:
        self.windows = self.unread = 0
        self._last: dict[str, Any] = {"watts": None, "kind": "unavailable", "frame_J": None, "stages_J": {}}

    def add(self, window: dict[str, Any], board: EnergyConfig) -> float | None:
        """Add a line modt.energy/1; the window's power [W]."""
        energy_J, frames = window["energy_J"], window["frames"][2]
        self.windows, self.unread = self.windows + 1, self.unread + (energy_J is None)
        watts = None if energy_J is None else energy_J / (1e-9 * window["wall_ns"])
        split = attribute(window, board) if frames else {}
        self._last = {
            "watts": watts,
            "kind": window["kind"],
            "frame_J": None if energy_J is None or not frames else energy_J / frames,
            "stages_J": {stage: round(joules / frames, 6) for stage, joules in split.items()},
        }
        return watts

    def report(self) -> dict[str, Any]:
        """Figures of the last window for the status, with the energy of each part of a frame (`attribute`)."""
        return {**self._last, "windows": self.windows, "unread_windows": self.unread}


def one_line(status: dict[str, Any]) -> str:
    """Rate, tracks and watts, as systemd shows them."""
    counts, loop, power = status["counts"], status["loop"], status["power"]
    classes = ", ".join(f"{n} {name}" for name, n in counts["visible"].items() if n and name != CLASS_NAMES[0])
    watts = "power unknown" if power["watts"] is None else f"{power['watts']:.1f} W {power['kind']}"
    step = "" if loop["step"] == "all" else f", load: {loop['step']}"
    silent = ", sensor silent" if status["sensor"].get("silent") else ""
    seen = f" ({classes})" if classes else ""
    return f"{counts['rate_hz']:.1f} Hz, {counts['tracks']} tracks{seen}, {watts}{step}{silent}"


def status_text(status: dict[str, Any], now_s: float) -> str:
    """Lines for a terminal, without control characters."""
    loop, sensor, recording = status["loop"], status["sensor"], status["recording"]
    age_s = now_s - status["time_s"]
    state = (
        f"running for {status['up_s']:.0f} s" if age_s < STALE_S else f"NOT running: last heard of {age_s:.0f} s ago"
    )
    entered = ", ".join(f"{step} {n} times" for step, n in loop["steps_entered"].items())
    power = status["power"]
    energy = "" if power["frame_J"] is None else f"{1e3 * power['frame_J']:.0f} mJ a frame, {power['kind']}"
    stages = ", ".join(f"{stage} {1e3 * joules:.1f}" for stage, joules in power.get("stages_J", {}).items() if joules)
    lines = [
        f"{status['source']}: {state}, mode {status['mode']}, profile {status['profile']}",
        f"  {one_line(status)}",
        f"  deadlines   {loop['missed_deadlines']} of {loop['frames']} missed, {loop['shed_sweeps']} sweeps left out",
        *(f"  {name:<11} {_times(loop[f'{name}_ms'])}" for name in ("lateness", "execution", "latency")),
        f"  budget      {loop['budget_ms']:.1f} ms for classification, {loop['other_stages_ms']:.1f} ms for the rest",
        f"  load        {loop['step']}" + (f" ({entered})" if entered else ""),
        f"  energy      {energy or 'unavailable'}",
        *([f"  by stage    {stages} mJ a frame, estimated"] if stages else []),
        f"  sensor      {_counts(sensor)}",
        f"  recording   {recording['failing'] or 'on'}, {recording['lines']} lines, {recording['lost_lines']} lost",
        *(f"  sink        {name}: {_counts(health)}" for name, health in status["sinks"].items()),
        *(f"  failures    {kind}: {n}" for kind, n in loop["failures"].items()),
        *(f"  warning     {what}" for what in status["host"]["lacking"]),
    ]
    return "\n".join("".join(c if c.isprintable() else "?" for c in line) for line in lines)


def _times(figures: dict[str, float]) -> str:
    return ", ".join(f"{name} {ms:.1f}" for name, ms in figures.items()) + " ms"


def _counts(health: dict[str, Any]) -> str:
    """Scalars that are not empty or zero."""
    shown = {key: value for key, value in health.items() if value and not isinstance(value, dict)}
    return ", ".join(f"{key.replace('_', ' ')} {value}" for key, value in shown.items()) or "nothing to report"
