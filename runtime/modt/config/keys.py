"""Every key of a profile, from the metadata of the configuration."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, fields
from typing import Any

from modt.config.base import StageConfig
from modt.config.profile import ProfileConfig


@dataclass(frozen=True, slots=True)
class Key:
    """One key of a profile.

    Attributes:
        path: of the key, with dots.
        default: without a profile.
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
        if isinstance(kind, type) and issubclass(kind, StageConfig):
            yield from keys(kind, f"{prefix}{f.name}.")
        else:
            yield Key(f"{prefix}{f.name}", f.default, str(f.type), dict(f.metadata))


def value_of(config: StageConfig | ProfileConfig, path: str) -> Any:
    """Value of a key."""
    value: Any = config
    for name in path.split("."):
        value = getattr(value, name)
    return value
