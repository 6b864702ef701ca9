"""Comparison of the first sweep with a profile, to tell whether it is the profile of this sensor."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from modt.config import ProfileConfig, SegmentationConfig, SensorConfig
from modt.placement import Mount
from modt.sensor_fit.beams import (
    COARSE_ORIGINS_M,
    BeamPattern,
    azimuth_ratio,
    beam_keys,
    cell_m,
    find_beams,
    nearest_profile,
    spacing_ratio,
    tangents,
)
from modt.sensor_fit.floor_slope import floor_slope
from modt.sensor_fit.levelling import delays_s, untwisted
from modt.sensor_fit.reflectance import NONE, reflectance_scale, usable_scale
from modt.sensor_fit.tilt import LEVEL_UP, MIN_TILT_DEG, Floor, find_floor, mount_height_m
from modt.types import Float32, Frame

MAX_SPACING_RATIO = 1.35
"""Greatest ratio of the beam spacings, median over the points."""
MAX_AZIMUTH_RATIO = 1.6
"""Greatest ratio of the spacings along a beam: a head may turn faster."""
CLEAR_CONTRAST = 0.98
"""Contrast of the beams below which a sweep may be twisted by roll and pitch, or bent by a drive, during it."""
N_SECTORS = 8
"""Number of sectors in which the beams of such a sweep are looked for."""
MIN_TWIST = np.deg2rad(1.0)
"""Least change of the slope of a floor during a sweep that is undone."""
FLOOR_SAMPLE = 4000
"""Greatest number of points by which this change is measured."""
MAX_HEIGHT_M = 0.15
"""Greatest difference of the height [m]."""
MAX_HEIGHT_SHARE = 0.2
"""Greatest difference as a share of the height; the greater of both limits counts."""


@dataclass(frozen=True)
class Recognition:
    """Differences between a profile and a sweep.

    Attributes:
        differences: a phrase for each, none if the profile fits.
        nearest: name of the shipped profile of the same beams, None where there is none.
        fitted: the profile, in which measured values replace those that differ.
        tilt_deg: roll and pitch of the sensor where the profile leaves them open and they are not small.
        same_sensor: whether all differences are those of the mount.
    """

    differences: tuple[str, ...]
    nearest: str | None
    fitted: ProfileConfig
    tilt_deg: tuple[float, float] | None = None
    same_sensor: bool = False

    @property
    def fits(self) -> bool:
        """Whether the beams are those of the profile, or too few points tell."""
        return self.same_sensor or not self.differences

    def mounted(self, config: ProfileConfig) -> ProfileConfig:
        """The profile with the measured tilt, if it leaves the mount open."""
        sensor = config.sensor
        if self.tilt_deg is None or not _is_open(sensor):
            return config
        roll_deg, pitch_deg = self.tilt_deg
        return replace(config, sensor=replace(sensor, roll_deg=roll_deg, pitch_deg=pitch_deg))

    def warnings(self, name: str, *, replaced: bool) -> Iterator[str]:
        """Yield a warning of the differences from the named profile, with the remedy, and a warning of the tilt."""
        if self.differences:
            done = "used instead: what the first sweep shows" if replaced else "used all the same"
            known = (
                f"--profile {self.nearest}, or " if self.nearest and self.nearest != name.partition(" ")[0] else ""
            )
            remedy = f"better: {known}a profile by modt profile fit"
            what = "has another mount than this sensor's" if self.same_sensor else "is not of this sensor"
            yield f"profile {name} {what} ({'; '.join(self.differences)}); {done}; {remedy}"
        if self.tilt_deg is not None:
            roll, pitch = self.tilt_deg
            how = "hangs upside down, " if abs(roll) > 90 else "is tilted, "
            done = "its sweeps are turned level; sensor.roll_deg and pitch_deg of a profile state the mount"
            yield f"the sensor {how}rolled by {roll:.1f} and pitched by {pitch:.1f} deg: {done}"


def recognise(points: Float32, config: ProfileConfig) -> Recognition:
    """Compare (N, 4) points of a sweep with a profile; a sweep of few points fits every profile."""
    points = points[(points[:, 0] != 0) | (points[:, 1] != 0)]
    pattern = _pattern(points)
    if pattern is None:
        return Recognition((), None, config)
    expected = config.sensor
    found = SensorConfig(**beam_keys(pattern))
    tangent = tangents(points)
    sensor_differences = _pattern_differences(expected, found, tangent)
    # Another sensor may have another mount, so only that of the same sensor says at what depth its floor is.
    floor = find_floor(points, None if sensor_differences else expected.height_m)
    tilted = floor and floor.tilt_deg() > MIN_TILT_DEG and _is_open(expected)
    tilt_deg = floor.roll_pitch_deg if floor and tilted else None
    mount = Mount.of(*(tilt_deg or (expected.roll_deg, expected.pitch_deg)))
    scale = reflectance_scale(points[:, 3])
    found = replace(found, height_m=mount_height_m([mount.turn(points[::2])], found))
    found = replace(found, reflectance=usable_scale(points, scale, found))
    if NONE not in {expected.reflectance, scale} and scale != expected.reflectance:
        sensor_differences.append(f"reflectance of another scale than {expected.reflectance}")
    mount_differences = _mount_differences(expected, found.height_m, mount, floor)
    if sensor_differences:
        fitted = _measured_profile(found, pattern)
    else:
        fitted = replace(config, sensor=replace(expected, height_m=found.height_m)) if mount_differences else config
    nearest = nearest_profile(found, tangent) if sensor_differences else None
    recognition = Recognition(
        (*sensor_differences, *mount_differences), nearest, fitted, tilt_deg, not sensor_differences
    )
    return replace(recognition, fitted=recognition.mounted(fitted))


def _pattern(points: Float32) -> BeamPattern | None:
    """Beams of (N, 4) points; None if they are too few."""
    pattern = find_beams([points], COARSE_ORIGINS_M)
    if pattern is None or pattern.contrast >= CLEAR_CONTRAST:
        return pattern
    untwisted_pattern = _untwisted_pattern(points)
    if untwisted_pattern is not None and untwisted_pattern.contrast > pattern.contrast:
        return untwisted_pattern
    return _pattern_of_sectors(points) or pattern


def _pattern_of_sectors(points: Float32) -> BeamPattern | None:
    """Beams of (N, 4) points in the sector of median spacing; None if few sectors show beams clearly.

    Compensation for a drive shifts the beams of each bearing by another angle, which blurs them in the whole sweep.
    """
    sector = ((np.arctan2(points[:, 1], points[:, 0]) / np.pi + 1) * (N_SECTORS / 2)).astype(np.int64) % N_SECTORS
    patterns = [find_beams([points[sector == i]], COARSE_ORIGINS_M[:1]) for i in range(N_SECTORS)]
    clear = [pattern for pattern in patterns if pattern is not None and pattern.contrast >= CLEAR_CONTRAST]
    if len(clear) < N_SECTORS / 2:
        return None
    return sorted(clear, key=lambda pattern: pattern.spacing_deg)[len(clear) // 2]


def _untwisted_pattern(points: Float32) -> BeamPattern | None:
    """Beams of (N, 4) points of a sensor that rolls and pitches during its sweep; None if it does not.

    The points of a beam lie on a cone in the sensor's own frame. Where a driver has moved them by another motion they
    do not, and the floor is twisted as they are.
    """
    floor = find_floor(points)
    if floor is None:
        return None
    mount = Mount.upright(floor.up)
    level = mount.level(Frame(0, 0.0, points, turn_s=1.0))  # a turn is the unit of time
    some = slice(None, None, 1 + len(points) // FLOOR_SAMPLE)
    xyz = level.points[some].T[:3].astype(np.float64)
    twisted = floor_slope(xyz, delays_s(level)[some], np.zeros(2), floor.depth_m)
    if twisted is None or np.abs(twisted.twist[0]).max() < MIN_TWIST:
        return None
    back = Mount(None if mount.R_level_sensor is None else mount.R_level_sensor.T)
    pattern = find_beams([back.turn(untwisted(level, twisted.twist).points)], COARSE_ORIGINS_M)
    return pattern if pattern is not None and len(pattern.elevations_deg) else None


def _measured_profile(found: SensorConfig, pattern: BeamPattern) -> ProfileConfig:
    """Profile of measured values, without what a sweep does not tell."""
    if found.height_m is not None:  # a small robot is near its sensor
        found = replace(found, min_range_m=min(found.min_range_m, found.height_m))
    cells = SegmentationConfig(cell_m=cell_m(pattern.spacing_deg, pattern.azimuth_step_deg))
    return ProfileConfig(sensor=found, segmentation=cells)


def _is_open(sensor: SensorConfig) -> bool:
    """Whether roll and pitch are measured in the first sweep, because a profile has none."""
    return sensor.roll_deg is None and sensor.pitch_deg is None


def _pattern_differences(expected: SensorConfig, found: SensorConfig, tangent: Float32) -> list[str]:
    differences = []
    if spacing_ratio(expected, found, tangent) > MAX_SPACING_RATIO:
        steps = (float(np.rad2deg(np.median(s.beams.step_rad(tangent)))) for s in (found, expected))
        differences.append("beams {:.2f} deg apart, not {:.2f}".format(*steps))
    if azimuth_ratio(expected, found) > MAX_AZIMUTH_RATIO:
        differences.append(f"returns {found.azimuth_step_deg:.2f} deg apart, not {expected.azimuth_step_deg:.2f}")
    return differences


def _mount_differences(
    expected: SensorConfig, height_m: float | None, mount: Mount, floor: Floor | None
) -> list[str]:
    differences = []
    stated_m = expected.height_m
    if stated_m and height_m and abs(height_m - stated_m) >= max(MAX_HEIGHT_M, MAX_HEIGHT_SHARE * stated_m):
        differences.append(f"{height_m:.2f} m above the ground, not {stated_m:.2f}")
    if floor is not None and not _is_open(expected):
        up = LEVEL_UP if mount.R_level_sensor is None else mount.R_level_sensor[2]
        if floor.tilt_deg(up) > MIN_TILT_DEG:
            differences.append("rolled by {:.1f} and pitched by {:.1f} deg".format(*floor.roll_pitch_deg))
    return differences
