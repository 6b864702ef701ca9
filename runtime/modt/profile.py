"""Profiles: YAML to configuration with strict keys, and back; several of them combined to one configuration."""

from __future__ import annotations

import difflib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, fields, replace
from pathlib import Path
from typing import Any

import yaml

from modt import assets
from modt.config import MountedSensor, ProfileConfig, ReadSensor, StageConfig, ValueRangeError, check, completed
from modt.errors import MisuseError

DEFAULT = "hdl-64e"
"""Profile of the sensor if none is asked for."""
Names = str | Path | Sequence[str | Path] | None
"""Names or files of profiles; later ones win key by key."""
MOUNT = frozenset({"height_m", "min_range_m", "max_range_m"})
"""Keys of the section `sensor` that go with any sensor. A profile with no others names no sensor."""
SENSORS = "sensors"
"""Section with the sensors of a robot that has several, by their names."""
SENSOR_SECTIONS = ("sensor", "segmentation")
"""Sections that belong into the profiles of the sensors where there are several."""
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


@dataclass(frozen=True)
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
        """Whether it sets a key of the sensor that is no key of its mount."""
        return not MOUNT.issuperset(self.settings.get("sensor", ()))


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
    stages = {f.name: f.default_factory for f in fields(ProfileConfig)}
    extends: tuple[str, ...] = ()
    place = str(origin)
    settings: dict[str, dict[str, Any]] = {}
    for key, node, line in _entries(root, origin, {EXTENDS: None, **stages}, "profile"):
        stage = stages.get(key)
        if isinstance(stage, type):
            settings[key] = _stage(stage, node, origin, line)
        elif key == SENSORS:
            sensors = _entries(node, origin, None, SENSORS, line)
            settings[key] = {sensor: _stage(MountedSensor, keys, origin, at) for sensor, keys, at in sensors}
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


def _stage(kind: type[StageConfig], node: yaml.Node, origin: Path | str, line: int) -> dict[str, Any]:
    """Values of the keys of a stage."""
    known = {f.name: f for f in fields(kind) if f.name != "name"}
    settings: dict[str, Any] = {}
    for key, value, at in _entries(node, origin, known, kind.__name__, line):
        plain = _plain(value, f"{origin}:{at}")
        settings[key] = completed(known[key], tuple(plain) if isinstance(plain, list) else plain)
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
    node: yaml.Node | None, origin: Path | str, known: Mapping[str, object] | None, what: str, line: int = 1
) -> Iterator[tuple[str, yaml.Node, int]]:
    """Key, value and line of each entry of a mapping. A loader of values has no lines, so the nodes are walked.

    Args:
        node: the mapping.
        origin: file, for messages.
        known: valid keys; None for any.
        what: name of the mapping, for messages.
        line: line of its key.
    """
    if node is None or (isinstance(node, yaml.ScalarNode) and node.value == ""):
        return
    if not isinstance(node, yaml.MappingNode):
        raise MisuseError(f"{origin}:{line}", f"{what} is no mapping", "write key: value lines")
    seen: set[str] = set()
    for key_node, value in node.value:
        key = str(key_node.value)
        at = key_node.start_mark.line + 1
        if known is not None and key not in known:
            near = difflib.get_close_matches(key, known, n=1, cutoff=0.0)
            raise MisuseError(f"{origin}:{at}", f"unknown key '{key}'", f"did you mean '{near[0]}'?")
        if key in seen:
            raise MisuseError(f"{origin}:{at}", f"key '{key}' appears twice", "keep one")
        seen.add(key)
        yield key, value, at


@dataclass(frozen=True)
class Resolved:
    """Profiles, combined.

    Attributes:
        layers: the profiles that are asked for, each after those that it extends; later ones win.
        config: the resulting configuration, based on the DEFAULT if none of them is of a sensor.
    """

    layers: tuple[Layer, ...]
    config: ProfileConfig

    def used(self, default: str) -> tuple[str, ...]:
        """Names of the profiles, after `default` if none of them is of a sensor."""
        names = tuple(layer.name for layer in self.layers)
        return names if self.sensor or self.config.sensors else (default, *names)

    @property
    def sensor(self) -> str | None:
        """Name of the last profile of a sensor; None if there is none."""
        return next((layer.name for layer in reversed(self.layers) if layer.of_sensor), None)

    def applied_to(self, base: ProfileConfig) -> ProfileConfig:
        """Another configuration with the values of the layers.

        Raises:
            MisuseError: the values contradict one another.
        """
        return _configured(self.layers, base)


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
    return Resolved(layers, _with_sensors(_alone(layers)))


def _alone(layers: tuple[Layer, ...]) -> ProfileConfig:
    """Configuration of layers, without the profiles of its sensors."""
    return _configured((*_assumed(layers), *layers), ProfileConfig())


def _with_sensors(config: ProfileConfig) -> ProfileConfig:
    """A configuration with the profiles of its sensors."""
    read = [_alone(_layers((mounted.profile,))) for mounted in config.sensors]
    sensors = tuple(ReadSensor.of(mounted, own) for mounted, own in zip(config.sensors, read, strict=True))
    return replace(config, sensors=sensors)


def _assumed(layers: Sequence[Layer]) -> tuple[Layer, ...]:
    """The profiles on which layers are based: none where one is of a sensor, else that of the first sensor.

    Raises:
        MisuseError: there are several sensors, and a layer sets what belongs into their profiles.
    """
    sensors = _merged(layers).get(SENSORS)
    if not sensors:
        return () if any(layer.of_sensor for layer in layers) else _layers([DEFAULT])
    for layer in layers:
        if section := next((name for name in SENSOR_SECTIONS if name in layer.settings), None):
            raise MisuseError(
                f"{layer.name}: {section}", f"stands beside {SENSORS}", "write it into the profiles of the sensors"
            )
    first = next(iter(sensors.values())).get("profile")
    return _layers([first]) if first else ()


def parse(text: str, origin: Path | str = "profile") -> ProfileConfig:
    """Configuration of a YAML text and of the profiles that it extends; raises as `resolve` does."""
    layers = _chain(read(text, origin, str(origin)), Path(origin), ())
    return _with_sensors(_configured(tuple(layers.values()), ProfileConfig()))


def dump(config: ProfileConfig) -> dict[str, dict[str, Any]]:
    """A profile as plain data, with all defaults and tuples as lists."""
    stages = asdict(config)
    sensors = {}
    for sensor in stages.pop(SENSORS):
        sensor.pop("read", None)  # its name is written
        name = sensor.pop("name")
        sensors[name] = _listed(sensor)
    plain = {stage: _listed(values) for stage, values in stages.items()}
    return {**plain, SENSORS: sensors} if sensors else plain


def _listed(values: Mapping[str, Any]) -> dict[str, Any]:
    return {key: list(value) if isinstance(value, tuple) else value for key, value in values.items()}


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
            layer = read(file.read(MAX_CHARACTERS + 1), path, name)
    except (OSError, UnicodeDecodeError) as error:
        raise MisuseError(path, f"cannot be read ({error})", "make it a readable UTF-8 file") from None
    stage = layer.settings.get("classification", {})
    if isinstance(stage, dict) and (path.parent / str(stage.get("model", ""))).is_file():
        stage["model"] = str(path.parent / stage["model"])
    for sensor in layer.settings.get(SENSORS, {}).values():
        for key in ("profile", "source"):
            beside = path.parent / sensor.get(key, "")
            if beside.is_file() or (key == "source" and sensor.get(key) and beside.exists()):
                sensor[key] = str(beside)
    return layer


def _merged(layers: Sequence[Layer]) -> dict[str, dict[str, Any]]:
    """Settings of layers, of which later ones win key by key."""
    merged: dict[str, dict[str, Any]] = {}
    for layer in layers:
        for stage, values in layer.settings.items():
            before = merged.get(stage, {})
            if stage == SENSORS:
                merged[stage] = {**before, **{key: {**before.get(key, {}), **keys} for key, keys in values.items()}}
            else:
                merged[stage] = {**before, **values}
    return merged


def _configured(layers: Sequence[Layer], base: ProfileConfig) -> ProfileConfig:
    merged = _merged(layers)
    of_sensors = merged.pop(SENSORS, {})
    try:
        sensors = tuple(MountedSensor(name=name, **keys) for name, keys in of_sensors.items()) or base.sensors
        stages = {stage: replace(getattr(base, stage), **values) for stage, values in merged.items()}
        return replace(base, **stages, sensors=sensors)
    except ValueRangeError as error:
        names = ", ".join(layer.name for layer in layers)
        raise MisuseError(f"{names}: {error.subject}", error.cause, error.remedy) from None
