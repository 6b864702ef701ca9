"""Generate the keys of a profile in docs/ and profiles/ from the configuration.

docs/profile-keys.md has the keys that a robot sets, profile-keys.yaml every key: it is a profile of all defaults;
profiles/profile.schema.json is their JSON Schema.
"""

from __future__ import annotations

import argparse
from pathlib import Path

from modt import assets
from modt.config.profile import Key, keys
from modt.profile.yaml_text import nested, value_text
from modt_desk.cli.profile_schema import FILE, schema_text
from tools.docs.sections import replace_section

DOCUMENT = Path(__file__).resolve().parents[2] / "docs" / "profile-keys.md"
WHOLE = DOCUMENT.with_suffix(".yaml")
SCHEMA = assets.folder("profiles") / FILE
MARK = "tools.docs.profile_keys"
PAGE = ("sensor", "classification", "scheduler", "odometry", "energy", "loop", "recording")
"""Stages whose own keys are on the page."""

CONDITIONS = {
    "sensor.blind_range_m": "sensor.blind_sectors_deg",
    "tracking.paper": "association: paper",
    "scheduler": "--mode accurate, efficient",
    "scheduler.worth": "a binding budget",
    "scheduler.cost": "scheduler.cpu_ms_per_frame or energy_mJ_per_frame",
    "fusion": "--mode accurate",
    "fusion.prior": "a model that states no frequency",
    "fusion.rule": "--mode accurate, efficient",
    "fusion.object_threshold": "--mode accurate, efficient",
    "fusion.min_object_probability": "--mode accurate, efficient",
    "fusion.first_view_min_hits": "--mode efficient",
    "fusion.start_frame": "--mode accurate, rule: product",
    "fusion.point_change": "--mode accurate, rule: product",
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


def condition(key: Key) -> str:
    """When a key has an effect; empty: always."""
    parts = key.path.split(".")
    prefixes = (".".join(parts[:n]) for n in range(len(parts), 0, -1))
    return next((CONDITIONS[prefix] for prefix in prefixes if prefix in CONDITIONS), "")


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
                when = "" if condition(key) == always else f" [{condition(key)}]"
                name = key.path.partition(".")[2]
                lines.append(
                    f"| `{name}` | {value_text(key.default)} | {key.bounds} | {key.facts['meaning']}{when} |"
                )
    return "\n".join(lines[1:])


def whole() -> str:
    """A profile of all defaults, each key with a comment."""
    head = "# Every key of a profile with its default. Written by python -m tools.docs.profile_keys.\n"
    return head + nested((key.path, f"{value_text(key.default)} # {meaning(key)}") for key in keys())


def meaning(key: Key) -> str:
    """Bounds, meaning and condition of a key."""
    when = f" [{condition(key)}]" if condition(key) else ""
    return f"{key.bounds}: {key.facts['meaning']}{when}"


def document() -> str:
    """The page with its section up to date."""
    return replace_section(DOCUMENT.read_text(encoding="utf-8"), MARK, page())


def main() -> None:
    argparse.ArgumentParser(description=__doc__).parse_args()
    DOCUMENT.write_text(document(), encoding="utf-8")
    WHOLE.write_text(whole(), encoding="utf-8")
    SCHEMA.write_text(schema_text(), encoding="utf-8")


if __name__ == "__main__":
    main()
