"""Several profiles, and the profiles that they extend, combined to one configuration."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

from modt import assets
from modt.config import ProfileConfig, ValueRangeError
from modt.errors import MisuseError
from modt.profile.yaml_text import MAX_CHARACTERS, Layer, read, value_text

DEFAULT = "hdl-64e"
"""Profile of the sensor if none is asked for."""
Names = str | Path | Sequence[str | Path] | None
"""Names or files of profiles; later ones win key by key."""


@dataclass(frozen=True, slots=True)
class Resolved:
    """Profiles, combined.

    Attributes:
        layers: the profiles that are asked for, each after those that it extends; later ones win.
        assumed: the DEFAULT profile, on which they are based if none of them sets a key of the sensor.
        config: the resulting configuration.
    """

    layers: tuple[Layer, ...]
    assumed: tuple[Layer, ...]
    config: ProfileConfig

    def used(self, default: str) -> tuple[str, ...]:
        """Names of the profiles, after `default` if none of them sets a key of the sensor."""
        names = tuple(layer.name for layer in self.layers)
        return names if self.sensor else (default, *names)

    @property
    def sensor(self) -> str | None:
        """Name of the last profile that sets a key of the sensor; None if none does."""
        return next((layer.name for layer in reversed(self.layers) if layer.of_sensor), None)

    def over(self, base: ProfileConfig) -> ProfileConfig:
        """Another configuration with the values of the layers.

        Raises:
            MisuseError: the values contradict one another.
        """
        return _configured(self.layers, base)

    def shown(self) -> str:
        """The configuration as YAML, itself a profile. A comment on each value names the profile that has set it."""
        text, layers = "", (*reversed(self.layers), *reversed(self.assumed))
        for stage, values in dump(self.config).items():
            text += f"{stage}:\n"
            for key, value in values.items():
                set_by = next((layer.name for layer in layers if key in layer.settings.get(stage, ())), "default")
                text += f"  {key}: {value_text(value)} # {set_by}\n"
        near_m = self.config.sensor.person_seen_from_m
        return text if near_m is None else f"{text}# a third of a person's height is in view from {near_m:.1f} m on\n"


def load(names: Names = None) -> ProfileConfig:
    """Configuration of profiles by name or file, of the DEFAULT if there are none; raises as `resolve` does."""
    return resolve(names).config


def resolve(names: Names = None) -> Resolved:
    """Read profiles by name or file, and the profiles that they extend.

    Raises:
        MisuseError: no such profile, unreadable, not YAML, an unknown key or a value out of range, with the
            line and the nearest valid key; profiles that extend one another in a circle.
    """
    layers = _layers((names,) if isinstance(names, str | Path) else names or ())
    assumed = () if any(layer.of_sensor for layer in layers) else _layers([DEFAULT])
    return Resolved(layers, assumed, _configured((*assumed, *layers), ProfileConfig()))


def parse(text: str, origin: Path | str = "profile") -> ProfileConfig:
    """Configuration of a YAML text and of the profiles that it extends; raises as `resolve` does."""
    layers = _chain(read(text, origin, str(origin)), Path(origin), ())
    return _configured(tuple(layers.values()), ProfileConfig())


def dump(config: ProfileConfig) -> dict[str, dict[str, Any]]:
    """A profile as plain data, with all defaults and tuples as lists."""
    return asdict(config, dict_factory=_listed)


def _listed(items: list[tuple[str, Any]]) -> dict[str, Any]:
    return {key: list(value) if isinstance(value, tuple) else value for key, value in items}


def _layers(names: Sequence[str | Path]) -> tuple[Layer, ...]:
    """Profiles in their order, each after those that it extends, and each once."""
    layers: dict[Path, Layer] = {}
    for name in names:
        path = assets.find("profiles", str(name), ".yaml")
        layers.pop(path.resolve(), None)  # named twice: it wins over the profiles between
        for file, layer in _chain(_read(path), path, ()).items():
            layers.setdefault(file, layer)
    return tuple(layers.values())


def _chain(layer: Layer, path: Path, within: tuple[Path, ...]) -> dict[Path, Layer]:
    """A profile by its resolved file, after the profiles that it extends; `within`: the files that lead to it."""
    chain: dict[Path, Layer] = {}
    within = (*within, path.resolve())
    for name in layer.extends:
        try:
            base = assets.find("profiles", name, ".yaml", path.parent)
        except MisuseError as error:
            raise MisuseError(f"{layer.place}: extends {name}", error.cause, error.remedy) from None
        if base.resolve() in within:
            circle = ", ".join(file.stem for file in within[within.index(base.resolve()) :])
            raise MisuseError(layer.place, f"extends itself, by way of {circle}", "remove one of these `extends`")
        for file, extended in _chain(_read(base), base, within).items():
            chain.setdefault(file, extended)
    return {**chain, path.resolve(): layer}


def _read(path: Path) -> Layer:
    name = path.stem if path.parent == assets.folder("profiles") else str(path)
    try:
        with path.open(encoding="utf-8") as file:
            return read(file.read(MAX_CHARACTERS + 1), path, name)
    except (OSError, UnicodeDecodeError) as error:
        raise MisuseError(path, f"cannot be read ({error})", "make it a readable UTF-8 file") from None


def _configured(layers: Sequence[Layer], base: ProfileConfig) -> ProfileConfig:
    merged: dict[str, dict[str, Any]] = {}
    for layer in layers:
        for stage, values in layer.settings.items():
            merged[stage] = {**merged.get(stage, {}), **values}
    try:
        return replace(base, **{stage: replace(getattr(base, stage), **values) for stage, values in merged.items()})
    except ValueRangeError as error:
        names = ", ".join(layer.name for layer in layers)
        raise MisuseError(f"{names}: {error.key}", error.cause, error.remedy) from None
