"""The status as metrics for Prometheus: a text, and a file of it for the textfile collector of its node exporter."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from modt.app.load_shedding import Step
from modt.sinks.output import replace_file
from modt.types import TrustLevel

COUNTERS = re.compile(
    r"(frames|proposals|classifications|deferred|missed_deadlines|shed_sweeps|reloads|refused_reloads|steps_entered"
    r"|failures|windows|unread_windows|\w*messages|\w*sweeps|silences|time_steps|faults|misfits|frames_without_reflectance|\w*lines|pauses|parts|written|failed|unsent|dropped|alone)"
)
"""Names of counters, which never decrease."""
LABELS = {
    "visible": "class",
    "left_out": "kind",
    "steps_entered": "step",
    "failures": "kind",
    "fates": "fate",
    "refused_messages": "reason",
    "stages_J": "stage",
    "alone": "sensor",
}
"""Label of the keys of each table."""


def metrics_text(status: Mapping[str, Any]) -> str:
    """Every number of a status, as modt_PART_NAME; names of counters end in _total."""
    lines: list[str] = []
    typed: set[str] = set()
    for name, labels, value in _samples(status):
        if name not in typed:
            typed.add(name)
            lines.append(f"# HELP {name} {_help(name)}")
            lines.append(f"# TYPE {name} {'counter' if name.endswith('_total') else 'gauge'}")
        inside = ",".join(f'{key}="{_escaped(text)}"' for key, text in labels.items())
        lines.append(f"{name}{{{inside}}} {value:.15g}" if inside else f"{name} {value:.15g}")
    return "\n".join(lines) + "\n"


def write_metrics(path: Path, metrics: str) -> None:
    """Replace a file by the text of the metrics, for every user to read.

    Raises:
        ModtError: it cannot be written; the file is left as it is.
    """
    replace_file(path, metrics, public=True)


Sample = tuple[str, dict[str, str], float]


def _samples(status: Mapping[str, Any]) -> Iterator[Sample]:
    """Name, labels and value of every number of a status."""
    for key in ("time_s", "up_s", "period_s"):
        yield f"modt_{key}", {}, status[key]
    yield "modt_loop_step", {}, Step[status["loop"]["step"].upper()]
    yield "modt_trust_level", {}, TrustLevel[status["trust"]["level"].upper()]
    for reason in status["trust"]["reasons"]:
        yield "modt_trust_reason", {"check": reason["check"]}, TrustLevel[reason["level"].upper()]
    for level, frames in status["trust"]["frames"].items():
        yield "modt_trust_frames_total", {"level": level}, frames
    if status["trust"]["visibility_m"] is not None:
        yield "modt_trust_visibility_metres", {}, status["trust"]["visibility_m"]
    for part in ("counts", "loop", "power", "sensor", "odometry", "recording", "host"):
        yield from _of_table(f"modt_{part}", status[part], {})
    for sink, health in status["sinks"].items():
        yield from _of_table("modt_sink", health, {"sink": sink})


def _of_table(prefix: str, table: Mapping[str, Any], labels: dict[str, str]) -> Iterator[Sample]:
    """Samples of a part of the status. The keys of a table inside it become a label."""
    for key, value in table.items():
        name = f"{prefix}_{key}" + ("_total" if COUNTERS.fullmatch(key) else "")
        if isinstance(value, bool | int | float):
            yield name, labels, float(value)
        elif isinstance(value, Mapping):
            label = LABELS.get(key, "quantile" if key.endswith("_ms") else "name")
            for entry, number in value.items():
                if isinstance(number, bool | int | float):
                    yield name, {**labels, label: str(entry)}, float(number)


HELP = {
    "modt_time_s": "time of this status [s since 1970]",
    "modt_up_s": "time since the start [s]",
    "modt_period_s": "time between two sweeps [s]",
    "modt_loop_step": f"load given up: {', '.join(f'{step.value} {step.name.lower()}' for step in Step)}",
    "modt_trust_level": f"trust: {', '.join(f'{level.value} {level.name.lower()}' for level in TrustLevel)}",
    "modt_trust_reason": "level of what is held against the results, by check",
    "modt_trust_frames_total": "frames by their trust",
    "modt_recording_fates": "frames by the fate of their line in the records",
    "modt_power_watts": "power of the last window, with idle power [W]",
    "modt_power_frame_J": "mean energy of a frame, with idle power [J]",
    "modt_power_stages_J": "mean energy of a frame by stage [J]",
    "modt_power_limit_W": "limit of the profile, loop.power_W [W]",
}
"""Meaning of metrics whose name does not say it."""


def _help(name: str) -> str:
    """Meaning of a metric; else the place of its field in the status."""
    part, _, key = name.removeprefix("modt_").removesuffix("_total").partition("_")
    return HELP.get(name, f"{key.replace('_', ' ')}, as {part}.{key} of status.json (docs/formats.md)")


def _escaped(text: str) -> str:
    return text.replace("\\", r"\\").replace('"', r"\"").replace("\n", r"\n")
