"""Profiles: YAML to configuration with strict keys, and back."""

from __future__ import annotations

import dataclasses
import difflib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import yaml

from modt import assets
from modt.config import ProfileConfig, StageConfig, ValueRangeError
from modt.errors import MisuseError

DEFAULT = "hdl-64e"


def load(name: str | None = None) -> ProfileConfig:
    """Read a profile by name or path, without one the default.

    Raises:
        MisuseError: no such profile, unreadable, not YAML, an unknown key or a value out of range, with the
            line and the nearest valid key.
    """
    path = assets.find("profiles", name or DEFAULT, ".yaml")
    try:
        return parse(path.read_text(encoding="utf-8"), path)
    except (OSError, UnicodeDecodeError) as error:
        raise MisuseError(path, f"cannot be read ({error})", "make it a readable UTF-8 file") from None


def parse(text: str, origin: Path | str = "profile") -> ProfileConfig:
    """Profile of a YAML text, in which every key is optional; raises as load does."""
    try:
        root = yaml.compose(text, Loader=yaml.SafeLoader)
    except yaml.YAMLError as error:
        mark = getattr(error, "problem_mark", None)
        place = f"{origin}:{mark.line + 1}" if mark else str(origin)
        cause = str(getattr(error, "problem", None) or "unreadable")
        raise MisuseError(place, f"no YAML ({cause})", "correct this line") from None
    stages = {f.name: f.default_factory for f in dataclasses.fields(ProfileConfig)}
    built: dict[str, Any] = {}
    for key, node, line in _entries(root, origin, stages, "profile"):
        stage = stages[key]
        assert isinstance(stage, type)
        built[key] = _stage(stage, node, origin, line)
    try:
        return ProfileConfig(**built)
    except ValueRangeError as error:
        raise MisuseError(f"{origin}: {error.key}", error.cause, error.remedy) from None


def dump(config: ProfileConfig) -> dict[str, dict[str, Any]]:
    """A profile as plain data, with all defaults and tuples as lists."""
    return dataclasses.asdict(config, dict_factory=_listed)


def _listed(items: list[tuple[str, Any]]) -> dict[str, Any]:
    return {key: list(value) if isinstance(value, tuple) else value for key, value in items}


def to_yaml(data: Mapping[str, Any]) -> str:
    """YAML text in the order of the keys."""
    return str(yaml.safe_dump(dict(data), sort_keys=False, allow_unicode=True))


def from_yaml(text: str, origin: Path | str) -> Any:
    """Plain data of a YAML text written by this package."""
    try:
        return yaml.safe_load(text)
    except yaml.YAMLError:
        raise MisuseError(origin, "no YAML", "give the run directory of a whole run") from None


def _stage(kind: type[StageConfig], node: yaml.Node, origin: Path | str, line: int) -> StageConfig:
    known = {f.name: f for f in dataclasses.fields(kind)}
    values: dict[str, Any] = {}
    lines: dict[str, int] = {}
    for key, value, at in _entries(node, origin, known, kind.__name__, line):
        lines[key] = at
        nested = known[key].default_factory
        if isinstance(nested, type) and issubclass(nested, StageConfig):
            values[key] = _stage(nested, value, origin, at)
            continue
        try:
            plain = yaml.safe_load(yaml.serialize(value))
        except yaml.YAMLError:
            raise MisuseError(f"{origin}:{at}", "no plain value", "write a number, a name or a list") from None
        values[key] = tuple(plain) if isinstance(plain, list) else plain
    try:
        return kind(**values)
    except ValueRangeError as error:
        place = f"{origin}:{lines.get(error.key, line)}: {error.key}"
        raise MisuseError(place, error.cause, error.remedy) from None


def _entries(
    node: yaml.Node | None, origin: Path | str, known: Mapping[str, object], what: str, line: int = 1
) -> list[tuple[str, yaml.Node, int]]:
    if node is None or (isinstance(node, yaml.ScalarNode) and node.value == ""):
        return []
    if not isinstance(node, yaml.MappingNode):
        raise MisuseError(f"{origin}:{line}", f"{what} is no mapping", "write key: value lines")
    entries: list[tuple[str, yaml.Node, int]] = []
    for key_node, value in node.value:
        key, at = str(key_node.value), key_node.start_mark.line + 1
        if key not in known:
            near = difflib.get_close_matches(key, known, n=1, cutoff=0.0)
            raise MisuseError(f"{origin}:{at}", f"unknown key '{key}'", f"did you mean '{near[0]}'?")
        if key in (seen for seen, _, _ in entries):
            raise MisuseError(f"{origin}:{at}", f"key '{key}' appears twice", "keep one")
        entries.append((key, value, at))
    return entries
