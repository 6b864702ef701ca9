"""Whether a profile is that of the sensor: the first sweep against it."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from modt.config import ProfileConfig, SensorConfig
from modt.sensor_fit.beams import (
    COARSE_ORIGINS_M,
    azimuth_ratio,
    find_beams,
    nearest_profile,
    spacing_ratio,
    tangents,
)
from modt.sensor_fit.findings import (
    NONE,
    Recording,
    apply,
    find_height,
    find_reflectance,
    pattern_findings,
    reflectance_scale,
)
from modt.types import Float32

MAX_SPACING_RATIO = 1.35  # of the beams, median over the points, and of the returns along a beam
MAX_AZIMUTH_RATIO = 1.6  # a head may turn faster
MAX_HEIGHT_SHARE, MAX_HEIGHT_M = 0.2, 0.15  # difference of the height: the greater of the two


@dataclass(frozen=True, slots=True)
class Recognition:
    """What differs between a profile and a sweep.

    Attributes:
        differences: in words, none if the profile fits.
        nearest: name of the shipped profile of the same beams, None where there is none.
        fitted: the profile with what was found in its place.
    """

    differences: tuple[str, ...]
    nearest: str | None
    fitted: ProfileConfig

    def warning(self, name: str, *, replaced: bool) -> str:
        """One line of what differs from the profile of a name, what became of it, and the remedy."""
        done = "used instead: what the first sweep shows" if replaced else "used all the same"
        known = f"--profile {self.nearest}, or " if self.nearest else ""
        remedy = f"better: {known}a profile by modt profile fit"
        return f"profile {name} is not of this sensor ({'; '.join(self.differences)}); {done}; {remedy}"


def recognise(points: Float32, config: ProfileConfig) -> Recognition:
    """Compare (N, 4) points of a sweep with a profile; a sweep of few points fits any."""
    points = points[(points[:, 0] != 0) | (points[:, 1] != 0)]
    pattern = find_beams([points], COARSE_ORIGINS_M)
    if pattern is None:
        return Recognition((), None, config)
    found = apply(ProfileConfig(), pattern_findings(pattern))
    found = apply(found, find_height(Recording([points[::2]], [0.0]), found))
    found = apply(found, find_reflectance(Recording([points], [0.0]), found))
    tangent = tangents(points)
    of_sensor = _pattern_differences(config.sensor, found.sensor, tangent)
    scale, _ = reflectance_scale(points[:, 3])
    if NONE not in {config.sensor.reflectance, scale} and scale != config.sensor.reflectance:
        of_sensor.append(f"reflectance of another scale than {config.sensor.reflectance}")
    of_mount = _height_differences(config.sensor.height_m, found.sensor.height_m)
    if of_sensor:
        return Recognition((*of_sensor, *of_mount), nearest_profile(found.sensor, tangent), _with_reach(found))
    if of_mount:
        mounted = replace(config.sensor, height_m=found.sensor.height_m)
        return Recognition(tuple(of_mount), None, replace(config, sensor=mounted))
    return Recognition((), None, config)


def _pattern_differences(expected: SensorConfig, found: SensorConfig, tangent: Float32) -> list[str]:
    said = []
    if spacing_ratio(expected, found, tangent) > MAX_SPACING_RATIO:
        steps = (float(np.rad2deg(np.median(s.beams.step_rad(tangent)))) for s in (found, expected))
        said.append("beams {:.2f} deg apart, not {:.2f}".format(*steps))
    if azimuth_ratio(expected, found) > MAX_AZIMUTH_RATIO:
        said.append(f"returns {found.azimuth_step_deg:.2f} deg apart, not {expected.azimuth_step_deg:.2f}")
    return said


def _height_differences(expected_m: float | None, found_m: float | None) -> list[str]:
    if (
        expected_m is None
        or found_m is None
        or abs(found_m - expected_m) < max(MAX_HEIGHT_M, MAX_HEIGHT_SHARE * expected_m)
    ):
        return []
    return [f"{found_m:.2f} m above the ground, not {expected_m:.2f}"]


def _with_reach(found: ProfileConfig) -> ProfileConfig:
    """Its least range no longer than its height: a small robot is near its sensor."""
    if found.sensor.height_m is None:
        return found
    least_m = min(found.sensor.min_range_m, found.sensor.height_m)
    return replace(found, sensor=replace(found.sensor, min_range_m=least_m))
