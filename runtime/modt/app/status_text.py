"""The status of a service as text."""

from __future__ import annotations

from typing import Any

from modt.app.status import STALE_S, one_line


def status_text(status: dict[str, Any], now_s: float) -> str:
    """Some lines for a terminal, without characters that would steer it."""
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
        *(f"  lacking     {what}" for what in status["host"]["lacking"]),
    ]
    return "\n".join("".join(c if c.isprintable() else "?" for c in line) for line in lines)


def _times(figures: dict[str, float]) -> str:
    return ", ".join(f"{name} {ms:.1f}" for name, ms in figures.items()) + " ms"


def _counts(health: dict[str, Any]) -> str:
    """Scalars that say something."""
    said = {key: value for key, value in health.items() if value and not isinstance(value, dict)}
    return ", ".join(f"{key.replace('_', ' ')} {value}" for key, value in said.items()) or "nothing to report"
