"""Values of a profile's keys, with the evidence for each, as sweeps of the sensor show them, and as text."""

from __future__ import annotations

import textwrap
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from modt.config import ProfileConfig, SegmentationConfig
from modt.placement import Mount
from modt.sensor_fit.beams import BeamPattern, beam_keys, cell_m
from modt.sensor_fit.reflectance import NONE, SCALES, recorded_in, reflectance_scale, usable_scale
from modt.sensor_fit.tilt import mount_height_m
from modt.types import Float32

RELIABLE_CONTRAST = 0.985
"""Least share of the points in the peaks of beams that are told apart without a doubt."""


@dataclass(frozen=True)
class Recording:
    """Some sweeps of a sensor.

    Attributes:
        sweeps: (N, 4) points of each [m, sensor frame], without those that lie at the origin.
        stamps_s: time of each.
    """

    sweeps: Sequence[Float32]
    stamps_s: Sequence[float]


@dataclass(frozen=True)
class Finding:
    """A value of a profile's key."""

    stage: str  # stage of the profile
    key: str  # key of the stage
    value: Any  # value of the key
    evidence: str  # the measurement, or the reason why none was possible
    reliable: bool = True  # measured well; else to be checked by the user


def apply(config: ProfileConfig, findings: Iterable[Finding]) -> ProfileConfig:
    """The profile with the values found."""
    for found in findings:
        stage = replace(getattr(config, found.stage), **{found.key: found.value})
        config = replace(config, **{found.stage: stage})
    return config


def pattern_findings(pattern: BeamPattern) -> Iterator[Finding]:
    """Keys of a pattern of beams."""
    found = pattern.elevations_deg
    reliable = True
    if len(found):
        spacing = f"{len(found)} beams from {found[-1]:.2f} to {found[0]:.2f} deg"
        azimuth = "most frequent step along a beam"
        reliable = pattern.contrast > RELIABLE_CONTRAST
        spacing += (
            "" if reliable else "; blurred, perhaps by compensation for motion: take a recording at a walking pace"
        )
    else:
        spacing = "no beams: spacing of the returns of a sweep, in any direction"
        azimuth = "the same"
    evidence = {
        "elevations_deg": f"{spacing}; a beam that met nothing is not among them",
        "elevation_step_deg": spacing,
        "azimuth_step_deg": azimuth,
    }
    for key, value in beam_keys(pattern).items():
        yield Finding("sensor", key, value, evidence[key], reliable or key == "azimuth_step_deg")
    side_m = cell_m(pattern.spacing_deg, pattern.azimuth_step_deg)
    if side_m != SegmentationConfig().cell_m:
        yield Finding("segmentation", "cell_m", side_m, "by the spacing of the returns")


def level(recording: Recording, config: ProfileConfig) -> Recording:
    """The recording of a level sensor."""
    mount = Mount.of(config.sensor.roll_deg, config.sensor.pitch_deg)
    return replace(recording, sweeps=[mount.turn(points) for points in recording.sweeps])


def find_height(recording: Recording, config: ProfileConfig) -> Iterator[Finding]:
    """Height of the sensor above the ground."""
    height_m = mount_height_m(level(recording, config).sweeps, config.sensor)
    if height_m is None:
        yield Finding("sensor", "height_m", None, "no flat ground in sight: estimated as it comes", reliable=False)
    else:
        yield Finding("sensor", "height_m", height_m, "above a plane through the ground around, median of the sweeps")


def find_reflectance(recording: Recording, config: ProfileConfig) -> Iterator[Finding]:
    """Scale of the reflectance."""
    points = np.concatenate(recording.sweeps)
    scale = reflectance_scale(points[:, 3])
    usable = usable_scale(points, scale, config.sensor)
    if scale == NONE:
        evidence = "none is recorded"
    else:
        median, most = np.quantile(recorded_in(points[:, 3]), [0.5, 0.9])
        evidence = f"median {median:.2f}, 90 % below {most:.2f}"
        if scale in SCALES:
            evidence = f"{'hundredths, ' * SCALES[scale].hundredths}{evidence}: as of the {scale}"
            evidence += "" if usable == scale else ", but these are other beams: not used"
        else:
            evidence += ": of no scale that models have learnt"
    yield Finding("sensor", "reflectance", usable, evidence)


CHECK = "check this"
WIDTH = 116


def profile_text(title: str, findings: Sequence[Finding]) -> str:
    """YAML of the fitted values; a comment states how each was measured."""
    lines = [f"# {title}"]
    stage = ""
    for found in sorted(findings, key=lambda f: [g.stage for g in findings].index(f.stage)):
        if found.stage != stage:
            stage = found.stage
            lines.append(f"{stage}:")
        evidence = found.evidence if found.reliable else f"{CHECK}: {found.evidence}"
        value = _plain(found.value)
        if len(value) > 20:
            lines += [f"  # {evidence}", *textwrap.wrap(f"{found.key}: {value}", WIDTH, **_INDENT)]
        else:
            lines.append(f"  {found.key}: {value} # {evidence}")
    return "\n".join(lines) + "\n"


_INDENT: dict[str, Any] = {"initial_indent": "  ", "subsequent_indent": "    "}


def _plain(value: Any) -> str:
    if isinstance(value, tuple):
        return f"[{', '.join(f'{number:g}' for number in value)}]"
    return "null" if value is None else f"{value:g}" if isinstance(value, float) else str(value)


def doubts(findings: Sequence[Finding]) -> list[str]:
    """A line for each uncertain value."""
    return [f"{f.stage}.{f.key}: {f.evidence}" for f in findings if not f.reliable]
