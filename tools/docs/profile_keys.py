"""Generate docs/profile-keys.md and .yaml from the configuration.

The page has the keys that a robot sets, the YAML file every key: it is a profile of all defaults.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

from modt.config import ProfileConfig, StageConfig
from tools.docs.sections import replace_section

DOCUMENT = Path(__file__).resolve().parents[2] / "docs" / "profile-keys.md"
WHOLE = DOCUMENT.with_suffix(".yaml")
MARK = "tools.docs.profile_keys"
PAGE = ("sensor", "classification", "scheduler", "odometry", "energy", "loop", "recording")
"""Stages whose own keys are on the page."""

CONDITIONS = {
    "sensor.blind_range_m": "sensor.blind_sectors_deg",
    "sensor.period_s": "a folder of scans",
    "segmentation.sensor_height": "sensor.height_m: null",
    "segmentation.sensor_height.default_m": "sensor.height_m: null, no ground in sight",
    "segmentation.view_margin": "--fov camera",
    "tracking.paper": "association: paper",
    "tracking.kdop": "association: kdop",
    "tracking.kdop.partial_factor": "association: kdop, --fov camera",
    "tracking.split": "association: kdop",
    "tracking.merge": "association: kdop",
    "tracking.background_map": "association: kdop",
    "scheduler": "--mode accurate, efficient",
    "scheduler.worth": "a binding budget",
    "scheduler.cost": "scheduler.cpu_ms_per_frame or energy_mJ_per_frame",
    "fusion": "--mode accurate",
    "fusion.prior": "a model that states no frequency",
    "fusion.box_update_weight": "--mode accurate, efficient",
    "fusion.mismatch_probability": "--mode accurate, efficient",
    "fusion.first_view_min_object_probability": "--mode efficient",
    "fusion.first_view_min_hits": "--mode efficient",
    "odometry": "--odometry udp://, unix://",
    "odometry.registration": "frames without a pose",
    "odometry.registration.initial_turn_rad": "the first frames without a pose",
    "odometry.landmarks": "frames without a pose",
    "energy": "figures of energy",
    "energy.idle_W": "figures of energy; scheduler.energy_mJ_per_frame",
    "energy.busy_W": "figures of energy; scheduler.energy_mJ_per_frame",
    "energy.meter": "none: kept in run.yaml",
    "loop": "modt run",
    "recording": "modt run",
}
"""When keys have an effect, by the longest prefix of their paths; keys without an entry always have."""


@dataclass(frozen=True, slots=True)
class Key:
    """One key of a profile.

    Attributes:
        path: of the key, with dots.
        default: without a profile.
        kind: type of its values.
        facts: low, high, unit, options and meaning.
    """

    path: str
    default: Any
    kind: str
    facts: dict[str, Any]

    @property
    def condition(self) -> str:
        """When it has an effect; empty: always."""
        parts = self.path.split(".")
        prefixes = (".".join(parts[:n]) for n in range(len(parts), 0, -1))
        return next((CONDITIONS[prefix] for prefix in prefixes if prefix in CONDITIONS), "")

    @property
    def bounds(self) -> str:
        """Bounds and unit, or options."""
        if "options" in self.facts:
            return ", ".join(self.facts["options"])
        if "low" not in self.facts:
            return "text"
        bounds = f"{self.facts['low']:g} to {self.facts['high']:g} {self.facts.get('unit', '')}".strip()
        return f"{bounds}, or null" if "None" in self.kind else bounds

    @property
    def value(self) -> str:
        """The default as YAML."""
        if isinstance(self.default, tuple):
            return f"[{', '.join(f'{number:g}' for number in self.default)}]"
        return "null" if self.default is None else f"{self.default}"


def keys(config: type[StageConfig] | type[ProfileConfig] = ProfileConfig, prefix: str = "") -> Iterator[Key]:
    """Every key, in the order of the configuration."""
    for f in fields(config):
        kind = f.default_factory
        if isinstance(kind, type) and issubclass(kind, StageConfig):
            yield from keys(kind, f"{prefix}{f.name}.")
        else:
            yield Key(f"{prefix}{f.name}", f.default, str(f.type), dict(f.metadata))


def page() -> str:
    """A table a stage, of the keys outside its mechanisms."""
    lines: list[str] = []
    own = [key for key in keys() if key.path.count(".") == 1]
    for stage in PAGE:
        always = CONDITIONS.get(stage, "")
        lines += ["", f"## {stage}", "", *([f"With {always}:", ""] if always else [])]
        lines += ["| key | default | from, to | meaning |", "|---|---|---|---|"]
        for key in own:
            if key.path.startswith(f"{stage}."):
                when = "" if key.condition == always else f" [{key.condition}]"
                name = key.path.partition(".")[2]
                lines.append(f"| `{name}` | {key.value} | {key.bounds} | {key.facts['meaning']}{when} |")
    return "\n".join(lines[1:])


def whole() -> str:
    """A profile of all defaults, each key with a comment."""
    lines = ["# Every key of a profile with its default. Written by python -m tools.docs.profile_keys."]
    opened: list[str] = []
    for key in keys():
        *groups, name = key.path.split(".")
        shared = next((n for n, pair in enumerate(zip(groups, opened, strict=False)) if pair[0] != pair[1]), None)
        for depth in range(min(len(groups), len(opened)) if shared is None else shared, len(groups)):
            lines.append(f"{'  ' * depth}{groups[depth]}:")
        opened = groups
        when = f" [{key.condition}]" if key.condition else ""
        lines.append(f"{'  ' * len(groups)}{name}: {key.value} # {key.bounds}: {key.facts['meaning']}{when}")
    return "\n".join(lines) + "\n"


def document() -> str:
    """The page with its section up to date."""
    return replace_section(DOCUMENT.read_text(encoding="utf-8"), MARK, page())


def main() -> None:
    argparse.ArgumentParser(description=__doc__).parse_args()
    DOCUMENT.write_text(document(), encoding="utf-8")
    WHOLE.write_text(whole(), encoding="utf-8")


if __name__ == "__main__":
    main()
