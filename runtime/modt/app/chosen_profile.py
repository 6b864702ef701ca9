"""The profile of a stream: what is asked for, else what the source names, else what the first sweep shows."""

from __future__ import annotations

import logging
from dataclasses import dataclass, replace

from modt import profile
from modt.config import ProfileConfig
from modt.sensor_fit.recognition import Recognition, recognise
from modt.sources.stream import StreamInfo
from modt.types import Frame

log = logging.getLogger(__name__)

FOUND = "as found"
"""Name of a sensor's profile that the first sweep has replaced."""


@dataclass(frozen=True, slots=True)
class ChosenProfile:
    """The profile of a stream.

    Attributes:
        config: the configuration.
        sensor: name of the sensor's profile, FOUND where the first sweep has replaced it.
        names: of all profiles put together, the sensor's first where nobody has asked for it.
        recognition: what differs between the first sweep and the profile.
    """

    config: ProfileConfig
    sensor: str
    names: tuple[str, ...]
    recognition: Recognition


def choose(asked_for: profile.Names, first: Frame | None, info: StreamInfo) -> ChosenProfile:
    """The profile of a stream by its first frame; what differs is warned of.

    What is found takes the place of the default profile, and of that which the source has named, never of one of a
    sensor that was asked for, but for a tilt of the mount that it leaves open; beams that the source knows are better
    than found ones.

    Raises:
        MisuseError: a profile that cannot be used.
    """
    asked = profile.resolve(asked_for)
    base = info.profile or profile.DEFAULT
    config = asked.config if asked.sensor else _with_beams(asked.over(profile.load(base)), info)
    recognition = Recognition((), None, config) if first is None else recognise(first.points, config)
    for line in recognition.warnings(asked.sensor or base, replaced=asked.sensor is None):
        log.warning("%s", line)
    if asked.sensor:
        return ChosenProfile(recognition.mounted(config), asked.sensor, asked.used(""), recognition)
    sensor = FOUND if recognition.differences else base
    config = _with_beams(asked.over(recognition.fitted), info)
    return ChosenProfile(config, sensor, asked.used(sensor), recognition)


def _with_beams(config: ProfileConfig, info: StreamInfo) -> ProfileConfig:
    if info.elevations_deg is None:
        return config
    return replace(config, sensor=replace(config.sensor, elevations_deg=info.elevations_deg))
