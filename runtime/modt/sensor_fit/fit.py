"""A profile from a recording: the finders in their order."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from modt.config import ProfileConfig, SegmentationConfig
from modt.geometry.field_of_view import BlindSectors
from modt.placement import Mount
from modt.sensor_fit.beams import BeamPattern, find_beams, nearest_profile, tangents
from modt.sensor_fit.mount import BODY_REACH_M, find_body, ground_height_m
from modt.sensor_fit.tilt import find_floor
from modt.types import Float32


@dataclass(frozen=True, slots=True)
class Recording:
    """Some sweeps of a sensor.

    Attributes:
        sweeps: (N, 4) points of each [m, sensor frame], without those that lie at the origin.
        stamps_s: time of each.
    """

    sweeps: Sequence[Float32]
    stamps_s: Sequence[float]


@dataclass(frozen=True, slots=True)
class Finding:
    """A value of a profile's key."""

    stage: str  # of the profile
    key: str  # of the stage
    value: Any  # of the key
    evidence: str  # what was measured, or why nothing could be
    sure: bool = True  # measured well; else to be checked by the user


Finder = Callable[[Recording, ProfileConfig], Iterable[Finding]]
"""Finds keys in a recording, given the profile that the finders before it have found."""


def apply(config: ProfileConfig, findings: Iterable[Finding]) -> ProfileConfig:
    """The profile with the values found."""
    for found in findings:
        stage = replace(getattr(config, found.stage), **{found.key: found.value})
        config = replace(config, **{found.stage: stage})
    return config


NONE, OTHER = "none", "other"
"""None recorded; a scale that models do not know."""


@dataclass(frozen=True, slots=True)
class Scale:
    """What a sensor reports in streets.

    Attributes:
        deciles: of its reflectances, the first to the ninth.
        max_difference: mean over the deciles.
        hundredths: whether all of them are, as no other sensor's; else others may have the same scale.
    """

    deciles: tuple[float, ...]
    max_difference: float
    hundredths: bool = False


SCALES = {
    "hdl-64e": Scale((0.0, 0.15, 0.20, 0.24, 0.28, 0.30, 0.32, 0.36, 0.41), 0.12, hundredths=True),
    "pandar64": Scale((0.004, 0.012, 0.020, 0.027, 0.035, 0.047, 0.063, 0.084, 0.117), 0.025),
}
"""Of KITTI's object frames, and of nine scans of PandaSet."""


def reflectance_scale(reflectance: Float32) -> tuple[str, str]:
    """Scale of (N,) reflectances, and what speaks for it."""
    recorded = reflectance[reflectance >= 0]
    if len(recorded) < 0.5 * len(reflectance) or not len(recorded) or np.ptp(recorded) == 0:
        return NONE, "none is recorded"
    deciles = np.quantile(recorded, np.arange(0.1, 0.95, 0.1))
    hundredths = np.mean(np.abs(recorded * 100 - np.rint(recorded * 100)) < 0.01) > 0.99
    of_scale = f"median {deciles[4]:.2f}, 90 % below {deciles[8]:.2f}"
    for name, scale in SCALES.items():
        near = np.abs(deciles - scale.deciles).mean() < scale.max_difference
        if near and (hundredths or not scale.hundredths):
            return name, f"{'hundredths, ' * scale.hundredths}{of_scale}: as of the {name}"
    return OTHER, f"{of_scale}: of no scale that models have learnt"


MAX_RANGE_M = 100.0
"""Objects farther away have too few returns to be known."""
MAX_MIN_RANGE_M = 2.0
HEIGHTS_M = (0.05, 5.0)
MAX_SPACING_DEG = 10.0
"""What a profile can state."""
EVEN_DEG, EVEN_SHARE = 0.05, 0.05
"""Deviation from even spacing of beams that a table is not worth: the greater of the two, and of the spacing."""
SURE_CONTRAST = 0.985
"""Least share of the points in the peaks of beams that are told apart without a doubt."""
EMPTY_SECTOR_DEG = 10.0
"""Least sector without a return that is mentioned."""
MOST_FLOORS, LEVEL_DEG = 10, 1.0
"""Sweeps whose floor is fitted, and tilt of a sensor that counts as level."""


def cell_m(spacing_deg: float, azimuth_step_deg: float) -> float:
    """Side of a cell at 10 m: the root of the mean spacing of the returns, as cells grow as the root of range."""
    return max(SegmentationConfig().cell_m, round(0.18 * float(np.sqrt(np.sqrt(spacing_deg * azimuth_step_deg))), 3))


def find_period(recording: Recording, config: ProfileConfig) -> Iterator[Finding]:
    """Time between sweeps."""
    steps = np.diff(recording.stamps_s)
    if not len(steps) or np.median(steps) <= 0:
        yield Finding("sensor", "period_s", config.sensor.period_s, "assumed: one sweep", sure=False)
    elif np.ptp(steps) < 1e-6:
        said = "time stamps are exactly even: perhaps made up, as those of a folder of scans"
        yield Finding("sensor", "period_s", round(float(steps[0]), 4), said, sure=False)
    else:
        said = f"median of {len(steps)} steps, {steps.min():.3f} to {steps.max():.3f} s"
        yield Finding("sensor", "period_s", round(float(np.median(steps)), 4), said)


def find_pattern(recording: Recording, config: ProfileConfig) -> Iterator[Finding]:
    """Beams, their spacing, and the size of a cell."""
    pattern = find_beams(recording.sweeps)
    if pattern is None:
        yield Finding("sensor", "elevation_step_deg", config.sensor.elevation_step_deg, "too few points", sure=False)
        return
    yield from pattern_findings(pattern)


def pattern_findings(pattern: BeamPattern) -> Iterator[Finding]:
    """Keys of a pattern of beams."""
    yield from _beam_findings(pattern)
    side_m, spacing = cell_m(pattern.spacing_deg, pattern.azimuth_step_deg), "by the spacing of the returns"
    if side_m != SegmentationConfig().cell_m:
        yield Finding("segmentation", "cell_m", side_m, spacing)


def _beam_findings(pattern: BeamPattern) -> Iterator[Finding]:
    found, step_deg = pattern.elevations_deg, round(pattern.azimuth_step_deg, 3)
    if not len(found):
        said = "no beams: spacing of the returns of a sweep, in any direction"
        step_deg = min(step_deg, MAX_SPACING_DEG)
        yield Finding("sensor", "elevation_step_deg", step_deg, said)
        yield Finding("sensor", "azimuth_step_deg", step_deg, "the same")
        return
    mean_deg = float(np.ptp(found)) / (len(found) - 1)
    said = f"{len(found)} beams from {found[-1]:.2f} to {found[0]:.2f} deg"
    sure = pattern.contrast > SURE_CONTRAST
    said += "" if sure else "; blurred, perhaps by compensation for motion: take a recording at a walking pace"
    if np.abs(np.diff(found) - mean_deg).max() < max(EVEN_DEG, EVEN_SHARE * mean_deg):
        yield Finding("sensor", "elevation_step_deg", min(round(mean_deg, 3), MAX_SPACING_DEG), said, sure)
    else:
        table = tuple(np.round(found[::-1], 2).tolist())
        yield Finding("sensor", "elevations_deg", table, f"{said}; a beam that met nothing is not among them", sure)
    yield Finding("sensor", "azimuth_step_deg", step_deg, "most frequent step along a beam")


def find_mount(recording: Recording, config: ProfileConfig) -> Iterator[Finding]:
    """Roll and pitch of the sensor, the median of sweeps."""
    floors = [floor for points in recording.sweeps[:MOST_FLOORS] if (floor := find_floor(points)) is not None]
    if not floors:
        yield Finding("sensor", "roll_deg", None, "no floor in sight: by the first sweep that shows one", sure=False)
        return
    angles = np.median([floor.roll_pitch_deg for floor in floors], axis=0)
    tilt_deg = float(np.median([floor.tilt_deg for floor in floors]))
    said = f"by the floor in {len(floors)} sweeps: the sensor is tilted by {tilt_deg:.1f} deg"
    for key, angle in zip(("roll_deg", "pitch_deg"), angles.tolist(), strict=True):
        yield Finding("sensor", key, round(angle, 1) if tilt_deg > LEVEL_DEG else 0.0, said)


def _level(recording: Recording, config: ProfileConfig) -> Recording:
    """The recording of a level sensor."""
    mount = Mount.of(config.sensor.roll_deg, config.sensor.pitch_deg)
    return replace(recording, sweeps=[mount.turn(points) for points in recording.sweeps])


def find_body_and_range(recording: Recording, config: ProfileConfig) -> Iterator[Finding]:
    """Returns of the robot itself, and the range of the others."""
    recording = _level(recording, config)
    points = np.concatenate(recording.sweeps)
    range_m = np.hypot(points[:, 0], points[:, 1])
    height_m = ground_height_m(recording.sweeps, replace(config.sensor, min_range_m=BODY_REACH_M))
    body = None if height_m is None else find_body(recording.sweeps, height_m)
    own = np.zeros(len(points), np.bool_)
    if body is not None and len(body.sectors_deg):
        bounds = tuple(np.round(body.sectors_deg, 1).ravel().tolist())
        said = "returns that move with the sensor; a wall along the way would look like that too"
        yield Finding("sensor", "blind_sectors_deg", bounds, said, sure=False)
        yield Finding("sensor", "blind_range_m", round(body.range_m, 2), "farthest of these")
        own = BlindSectors(bounds, body.range_m).contain(points)
    nearest = min(MAX_MIN_RANGE_M, float(np.floor(10 * np.quantile(range_m[~own], 0.001))) / 10)
    said = f"of 0.1 % of the returns, at most {MAX_MIN_RANGE_M:g}"
    if body is None:
        said += "; whether they are on the robot is not known: the recording stands still or is too short"
    yield Finding("sensor", "min_range_m", nearest, said, sure=body is not None)
    farthest = float(10 * np.ceil(np.quantile(range_m, 0.999) / 10))
    said = f"of 99.9 % of the returns, at most {MAX_RANGE_M:g}"
    yield Finding("sensor", "max_range_m", min(MAX_RANGE_M, farthest), f"{said}{empty_sectors(points)}")


def empty_sectors(points: Float32) -> str:
    """The sectors without a return, in words; empty where there are none."""
    azimuth_deg = np.sort(np.rad2deg(np.arctan2(points[:, 1], points[:, 0])))
    gap = np.diff(np.append(azimuth_deg, azimuth_deg[0] + 360))
    wide = np.flatnonzero(gap > EMPTY_SECTOR_DEG)
    words = [f"{azimuth_deg[k]:.0f} to {(azimuth_deg[k] + gap[k] + 180) % 360 - 180:.0f}" for k in wide]
    return f"; no returns at all from {' and from '.join(words)} deg" if words else ""


def find_height(recording: Recording, config: ProfileConfig) -> Iterator[Finding]:
    """Height of the sensor above the ground."""
    height_m = ground_height_m(_level(recording, config).sweeps, config.sensor)
    if height_m is None or not HEIGHTS_M[0] <= height_m <= HEIGHTS_M[1]:
        yield Finding("sensor", "height_m", None, "no flat ground in sight: estimated as it comes", sure=False)
    else:
        yield Finding(
            "sensor", "height_m", round(height_m, 2), "above a plane through the ground around, median of the sweeps"
        )


def find_reflectance(recording: Recording, config: ProfileConfig) -> Iterator[Finding]:
    """Scale of the reflectance; one that several sensors have counts with the beams of the one that models know."""
    points = np.concatenate(recording.sweeps)
    scale, said = reflectance_scale(points[:, 3])
    known = SCALES.get(scale)
    if known and not known.hundredths and nearest_profile(config.sensor, tangents(points)) != scale:
        known, said = None, f"{said}, but these are other beams: not used"
    yield Finding("sensor", "reflectance", scale if known else NONE, said)


FINDERS: tuple[Finder, ...] = (
    *(find_period, find_pattern, find_mount),
    *(find_body_and_range, find_height, find_reflectance),
)
"""Each knows what those before it have found."""


def fit(recording: Recording, finders: Sequence[Finder] = FINDERS) -> tuple[ProfileConfig, list[Finding]]:
    """Profile of a recording's sensor, and the findings that it is made of."""
    config, findings = ProfileConfig(), list[Finding]()
    for finder in finders:
        found = list(finder(recording, config))
        config = apply(config, found)
        findings += found
    return config, findings
