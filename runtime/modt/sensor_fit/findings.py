"""Values of a profile's keys, as sweeps of the sensor show them."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from modt.config import ProfileConfig, SegmentationConfig, SensorConfig
from modt.geometry.field_of_view import BlindSectors
from modt.placement import Mount
from modt.sensor_fit.beams import BeamPattern, nearest_profile, tangents
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


HEIGHTS_M = (0.05, 5.0)
MAX_SPACING_DEG = 10.0
"""What a profile can state."""
EVEN_DEG, EVEN_SHARE = 0.05, 0.05
"""Deviation from even spacing of beams that a table is not worth: the greater of the two, and of the spacing."""
SURE_CONTRAST = 0.985
"""Least share of the points in the peaks of beams that are told apart without a doubt."""


def cell_m(spacing_deg: float, azimuth_step_deg: float) -> float:
    """Side of a cell at 10 m: the root of the mean spacing of the returns, as cells grow as the root of range."""
    return max(SegmentationConfig().cell_m, round(0.18 * float(np.sqrt(np.sqrt(spacing_deg * azimuth_step_deg))), 3))


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


def ground_height_m(sweeps: Sequence[Float32], sensor: SensorConfig) -> float | None:
    """Height above the floor, median over level sweeps of (N, 4) points [m]; None where none shows one."""
    sectors = BlindSectors(sensor.blind_sectors_deg or (), sensor.blind_range_m)
    heights_m = []
    for points in sweeps:
        kept = points[(np.hypot(points[:, 0], points[:, 1]) > sensor.min_range_m) & ~sectors.contain(points)]
        floor = find_floor(kept)
        if floor is not None and floor.up[2] > 0:
            heights_m.append(floor.depth_m)
    return float(np.median(heights_m)) if heights_m else None


def level(recording: Recording, config: ProfileConfig) -> Recording:
    """The recording of a level sensor."""
    mount = Mount.of(config.sensor.roll_deg, config.sensor.pitch_deg)
    return replace(recording, sweeps=[mount.turn(points) for points in recording.sweeps])


def find_height(recording: Recording, config: ProfileConfig) -> Iterator[Finding]:
    """Height of the sensor above the ground."""
    height_m = ground_height_m(level(recording, config).sweeps, config.sensor)
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
