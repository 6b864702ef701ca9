"""YAML of profiles: from text to settings with strict keys, and from values to text."""

from __future__ import annotations

import dataclasses
import difflib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import yaml

from modt.config import ProfileConfig, StageConfig, ValueRangeError
from modt.config.base import check
from modt.errors import MisuseError

EXTENDS = "extends"
"""Key that names the profiles on which a profile is based."""

MAX_CHARACTERS = 100_000
"""Greatest length of a text; the longest shipped profile has 2,000 characters."""


class _Loader(yaml.SafeLoader):
    """Loader that refuses aliases: a few lines of them stand for any number of values."""

    def compose_node(self, parent: yaml.Node | None, index: int) -> yaml.Node | None:
        """Compose a node, unless it is an alias."""
        if self.check_event(yaml.AliasEvent):
            parser: Any = self  # its stubs are incomplete
            raise yaml.MarkedYAMLError(problem="an alias", problem_mark=parser.peek_event().start_mark)
        return super().compose_node(parent, index)


@dataclass(frozen=True, slots=True)
class Layer:
    """One profile as written.

    Attributes:
        name: its name or file.
        settings: values by stage and key.
        extends: names of the profiles on which it is based.
        place: file and line of that key, or the file alone without it.
    """

    name: str
    settings: Mapping[str, Mapping[str, Any]]
    extends: tuple[str, ...]
    place: str

    @property
    def of_sensor(self) -> bool:
        """Whether it sets a key of the sensor."""
        return bool(self.settings.get("sensor"))


def read(text: str, origin: Path | str, name: str) -> Layer:
    """The profile of a YAML text, in which every key is optional; messages name its `origin`.

    Raises:
        MisuseError: not YAML, an unknown key or a value out of range, with the line and the nearest valid key.
    """
    try:
        root = yaml.compose(_bounded(text), Loader=_Loader)
    except (yaml.YAMLError, RecursionError) as error:
        mark = getattr(error, "problem_mark", None)
        place = f"{origin}:{mark.line + 1}" if mark else str(origin)
        cause = str(getattr(error, "problem", None) or "unreadable")
        raise MisuseError(place, f"no YAML ({cause})", "correct this line") from None
    stages = {f.name: f.default_factory for f in dataclasses.fields(ProfileConfig)}
    extends, place, settings = tuple[str, ...](), str(origin), dict[str, dict[str, Any]]()
    for key, node, line in _entries(root, origin, {EXTENDS: None, **stages}, "profile"):
        stage = stages.get(key)
        if isinstance(stage, type):
            settings[key] = _stage(stage, node, origin, line)
        else:
            place = f"{origin}:{line}"
            extends = _names(_plain(node, place), place)
    return Layer(name, settings, extends, place)


def to_yaml(data: Mapping[str, Any]) -> str:
    """YAML text in the order of the keys."""
    return str(yaml.safe_dump(dict(data), sort_keys=False, allow_unicode=True))


def from_yaml(text: str, origin: Path | str) -> Any:
    """Plain data of a YAML text written by this package."""
    try:
        return yaml.load(_bounded(text), Loader=_Loader)
    except (yaml.YAMLError, ValueError, RecursionError):
        raise MisuseError(origin, "no YAML", "give the run directory of a whole run") from None


def value_text(value: Any) -> str:
    """A value on one line."""
    plain = list(value) if isinstance(value, tuple) else value
    text: str = yaml.safe_dump(plain, default_flow_style=True, allow_unicode=True, width=float("inf"))
    return text.removesuffix("\n").removesuffix("\n...")


def _stage(kind: type[StageConfig], node: yaml.Node, origin: Path | str, line: int) -> dict[str, Any]:
    """Values of the keys of a stage."""
    known = {f.name: f for f in dataclasses.fields(kind)}
    settings: dict[str, Any] = {}
    for key, value, at in _entries(node, origin, known, kind.__name__, line):
        plain = _plain(value, f"{origin}:{at}")
        settings[key] = tuple(plain) if isinstance(plain, list) else plain
        try:
            check(known[key], settings[key])
        except ValueRangeError as error:
            raise MisuseError(f"{origin}:{at}: {key}", error.cause, error.remedy) from None
    return settings


def _bounded(text: str) -> str:
    if len(text) > MAX_CHARACTERS:
        raise yaml.MarkedYAMLError(problem=f"more than {MAX_CHARACTERS} characters")
    return text


def _names(plain: Any, place: str) -> tuple[str, ...]:
    names = plain if isinstance(plain, list) else [plain]
    if not all(isinstance(name, str) for name in names):
        raise MisuseError(place, f"{EXTENDS} is no name", "write the name or file of a profile, or a list of them")
    return tuple(names)


def _plain(node: yaml.Node, place: str) -> Any:
    try:
        return yaml.safe_load(yaml.serialize(node))
    except (yaml.YAMLError, ValueError):
        raise MisuseError(place, "no plain value", "write a number, a name or a list") from None


def _entries(
    node: yaml.Node | None, origin: Path | str, known: Mapping[str, object], what: str, line: int = 1
) -> Iterator[tuple[str, yaml.Node, int]]:
    if node is None or (isinstance(node, yaml.ScalarNode) and node.value == ""):
        return
    if not isinstance(node, yaml.MappingNode):
        raise MisuseError(f"{origin}:{line}", f"{what} is no mapping", "write key: value lines")
    seen: set[str] = set()
    for key_node, value in node.value:
        key, at = str(key_node.value), key_node.start_mark.line + 1
        if key not in known:
            near = difflib.get_close_matches(key, known, n=1, cutoff=0.0)
            raise MisuseError(f"{origin}:{at}", f"unknown key '{key}'", f"did you mean '{near[0]}'?")
        if key in seen:
            raise MisuseError(f"{origin}:{at}", f"key '{key}' appears twice", "keep one")
        seen.add(key)
        yield key, value, at
