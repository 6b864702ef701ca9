"""The profile of a stream: the requested one, or the one that the source names, or what the first sweep shows."""

from __future__ import annotations

import logging
from dataclasses import dataclass, replace

import numpy as np

from modt import profile
from modt.app.assembly import sensor_profile
from modt.config import ProfileConfig
from modt.profile import Resolved
from modt.sensor_fit.beams import can_show_beams
from modt.sensor_fit.recognition import Recognition, recognise
from modt.sources.stream import StreamInfo
from modt.types import Frame

log = logging.getLogger(__name__)

FOUND = "as found"
"""Name of a sensor's profile that the first sweep has replaced."""
STEP_DEG = 0.01, 10.0
"""Least and greatest step along a beam that a profile may state [deg]."""
GIVEN = "given"
"""Name of a configuration that a program has given."""


@dataclass(frozen=True)
class ChosenProfile:
    """The profile of a stream.

    Attributes:
        config: the configuration.
        sensor: name of the sensor's profile, FOUND where the first sweep has replaced it.
        names: names of the combined profiles. A sensor's profile that nobody requested comes first.
        recognition: differences between the first sweep and the profile.
    """

    config: ProfileConfig
    sensor: str
    names: tuple[str, ...]
    recognition: Recognition

    @property
    def name(self) -> str:
        """Names of all profiles that were combined."""
        return " + ".join(self.names)

    @property
    def fits(self) -> bool:
        """Whether the beams are those of the first sweep."""
        return self.sensor == FOUND or self.recognition.fits


class AwaitedSweep:
    """The sweeps that tell the sensor: the first one and, if it has too few points, the first one with enough."""

    def __init__(self) -> None:
        self._began = False
        self._told = False

    def comes_with(self, frame: Frame) -> bool:
        """Whether the profile is to be chosen by this frame."""
        return not self._began or (not self._told and can_show_beams(frame.points))

    def take(self, frame: Frame) -> None:
        """Note that the profile was chosen by this frame."""
        self._began = True
        self._told = can_show_beams(frame.points)


def choose(requested: Resolved | ProfileConfig, first: Frame | None, info: StreamInfo | None) -> ChosenProfile:
    """Choose the profile of a stream by its first frame, and log the differences as warnings.

    The findings of the first frame replace the default profile, or the profile that the source names. They never
    replace the profile of a requested sensor, except for a tilt that this profile leaves open. Beams that the source
    states take precedence over beams that are found.

    Raises:
        MisuseError: a profile that cannot be used.
    """
    if isinstance(requested, ProfileConfig):
        return _given(requested, first)
    config = requested.config
    if config.sensors:
        return _several(config, requested.used(""), first)
    if requested.sensor:
        config = _at_speed_of(first, config, requested.sensor)
        recognition = _compared(first, config, requested.sensor, replaced=False)
        return ChosenProfile(recognition.mounted(config), requested.sensor, requested.used(""), recognition)
    base = info.profile if info and info.profile else profile.DEFAULT
    name = f"{base} (the default)"
    config = _with_beams(requested.applied_to(profile.load(base)), info)
    if info and info.profile:
        name = base
        config = _at_speed_of(first, config, base)
    recognition = _compared(first, config, name, replaced=True)
    sensor = FOUND if recognition.differences else base
    config = _with_beams(requested.applied_to(recognition.fitted), info)
    return ChosenProfile(config, sensor, requested.used(sensor), recognition)


def _given(config: ProfileConfig, first: Frame | None) -> ChosenProfile:
    """The configuration that a program has given."""
    if config.sensors:
        return _several(config, (GIVEN,), first)
    config = _at_speed_of(first, config, GIVEN)
    recognition = _compared(first, config, GIVEN, replaced=False)
    return ChosenProfile(recognition.mounted(config), GIVEN, (GIVEN,), recognition)


def _several(config: ProfileConfig, names: tuple[str, ...], first: Frame | None) -> ChosenProfile:
    """The profile of several sensors, whose first sweeps are compared with the profiles of theirs."""
    differences: list[str] = []
    sweeps = first.sweeps if first is not None and first.sweeps else (None,) * len(config.sensors)
    for mounted, sweep in zip(config.sensors, sweeps, strict=True):
        found = _compared(
            sweep, sensor_profile(mounted), f"{mounted.profile} of sensor {mounted.name}", replaced=False
        )
        differences += [] if found.fits else [f"{mounted.name}: {difference}" for difference in found.differences]
    of_sensors = " + ".join(mounted.profile for mounted in config.sensors)
    return ChosenProfile(config, of_sensors, names, Recognition(tuple(differences), None, config))


def _at_speed_of(first: Frame | None, config: ProfileConfig, name: str) -> ProfileConfig:
    """The profile of a name at the speed of the head at which the first sweep fits it; as it is if at none.

    A head that turns twice as fast as that of the profile leaves returns twice as far apart. The beams are the same.
    """
    if first is None or recognise(first.points, config).fits:
        return config
    for speed in (0.5, 2.0):
        step_deg = float(np.clip(speed * config.sensor.azimuth_step_deg, *STEP_DEG))
        turned = replace(config, sensor=replace(config.sensor, azimuth_step_deg=step_deg))
        if recognise(first.points, turned).fits:
            log.warning(
                "the head turns at %g times the speed of profile %s: its returns are taken as %.3g deg apart; "
                "sensor.azimuth_step_deg of a profile states it",
                *(speed, name, step_deg),
            )
            return turned
    return config


def _compared(first: Frame | None, config: ProfileConfig, name: str, *, replaced: bool) -> Recognition:
    """Compare a sweep with the profile of a name; `replaced` says whether the findings take its place."""
    recognition = Recognition((), None, config) if first is None else recognise(first.points, config)
    for line in recognition.warnings(name, replaced=replaced):
        log.warning("%s", line)
    return recognition


def _with_beams(config: ProfileConfig, info: StreamInfo | None) -> ProfileConfig:
    if info is None or info.elevations_deg is None:
        return config
    return replace(config, sensor=replace(config.sensor, elevations_deg=info.elevations_deg))
