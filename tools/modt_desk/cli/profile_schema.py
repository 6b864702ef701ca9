"""`modt profile schema`: the JSON Schema of a profile, from the metadata of the configuration."""

from __future__ import annotations

import argparse
import json
from typing import Any

from modt.cli import options
from modt.config.profile import Key, keys
from modt.profile.yaml_text import EXTENDS

FILE = "profile.schema.json"
"""Its name in profiles/."""


def add_parser(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Declare the command."""
    p = commands.add_parser("schema", help="print the JSON Schema of a profile, for editors")
    options.add_examples(
        p,
        "modt profile schema > profile.schema.json   for the line `# yaml-language-server: $schema=`",
    )
    p.set_defaults(run=run)


def run(_arguments: argparse.Namespace) -> int:
    """Print it."""
    print(schema_text(), end="")
    return 0


def schema_text() -> str:
    """The schema (draft 7) of a profile file."""
    root = _mapping("Profile of a robot: its sensor and its board")
    name = {"type": "string"}
    base = "name or file of the profiles that this one is based on"
    root["properties"][EXTENDS] = {"description": base, "anyOf": [name, {"type": "array", "items": name}]}
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
    if "length" in facts:
        kind = {"type": "array", "items": kind, "minItems": facts["length"], "maxItems": facts["length"]}
    elif "most" in facts:
        kind = {"type": "array", "items": kind, "minItems": facts["least"], "maxItems": facts["most"]}
    if key.nullable:
        kind["type"] = [kind["type"], "null"]
    return described | kind
