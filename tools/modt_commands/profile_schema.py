"""`modt profile schema`: the JSON Schema of a profile, from the metadata of the configuration."""

from __future__ import annotations

import argparse
import json
from collections.abc import Iterator
from dataclasses import dataclass, fields
from typing import Any

from modt.cli import options
from modt.config import MountedSensor, ProfileConfig, StageConfig
from modt.profile import EXTENDS, SENSORS


@dataclass(frozen=True)
class Key:
    """One key of a profile.

    Attributes:
        path: path of the key, with dots.
        default: value without a profile.
        kind: type of its values.
        facts: low, high, unit, options, number of values and meaning.
    """

    path: str
    default: Any
    kind: str
    facts: dict[str, Any]

    @property
    def bounds(self) -> str:
        """Bounds and unit, or options."""
        if "options" in self.facts:
            return ", ".join(self.facts["options"])
        if "low" not in self.facts:
            return "text"
        bounds = f"{self.facts['low']:g} to {self.facts['high']:g} {self.facts.get('unit', '')}".strip()
        return f"{bounds}, or null" if self.nullable else bounds

    @property
    def nullable(self) -> bool:
        """Whether null is a value."""
        return "None" in self.kind

    @property
    def whole(self) -> bool:
        """Whether its numbers are integers."""
        return self.kind.startswith("int")


def keys(config: type[StageConfig] | type[ProfileConfig] = ProfileConfig, prefix: str = "") -> Iterator[Key]:
    """Every key, in the order of the configuration."""
    for f in fields(config):
        kind = f.default_factory
        if f.name == SENSORS:
            continue  # a section of sections, as below
        if isinstance(kind, type) and issubclass(kind, StageConfig):
            yield from keys(kind, f"{prefix}{f.name}.")
        else:
            yield Key(f"{prefix}{f.name}", f.default, str(f.type), dict(f.metadata))


FILE = "profile.schema.json"
"""Name of the schema in profiles/."""


def add_parser(commands: options.Commands) -> None:
    """Declare the command."""
    p = commands.add_parser("schema", help="print the JSON Schema of a profile, for editors")
    options.add_examples(
        p, "modt profile schema > profile.schema.json   for the line `# yaml-language-server: $schema=`"
    )
    p.set_defaults(run=run)


def run(_arguments: argparse.Namespace) -> int:
    """Print the schema."""
    print(schema_text(), end="")
    return 0


def schema_text() -> str:
    """The schema (draft 7) of a profile file."""
    root = _mapping("Profile of a robot: its sensor and its board")
    name = {"type": "string"}
    base = "name or file of the profiles that this one is based on"
    root["properties"][EXTENDS] = {"description": base, "anyOf": [name, {"type": "array", "items": name}]}
    of_sensor = _mapping("sensor")
    of_sensor["properties"] = {key.path: _value(key) for key in keys(MountedSensor) if key.path != "name"}
    sensors = "sensors of a robot with several, by their names, in place of the sections sensor and segmentation"
    root["properties"][SENSORS] = {"description": sensors, "type": "object", "additionalProperties": of_sensor}
    for key in keys():
        *groups, last = key.path.split(".")
        place = root
        for group in groups:
            place = place["properties"].setdefault(group, _mapping(group))
        place["properties"][last] = _value(key)
    return json.dumps({"$schema": "http://json-schema.org/draft-07/schema#", **root}, indent=1) + "\n"


def _mapping(title: str) -> dict[str, Any]:
    return {"title": title, "type": ["object", "null"], "additionalProperties": False, "properties": {}}


def _value(key: Key) -> dict[str, Any]:
    facts = key.facts
    described = {"description": f"{facts['meaning']} [{key.bounds}]", "default": key.default}
    if "options" in facts:
        return {**described, "enum": list(facts["options"])}
    kind: dict[str, Any] = {"type": "string"}
    if "low" in facts:
        kind = {"type": "integer" if key.whole else "number", "minimum": facts["low"], "maximum": facts["high"]}
    if "most" in facts:
        kind = {"type": "array", "items": kind, "minItems": facts["least"], "maxItems": facts["most"]}
    if key.nullable:
        kind["type"] = [kind["type"], "null"]
    return described | kind
