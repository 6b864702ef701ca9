"""Configuration of a sensor."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

from modt.classes import PERSON_HEIGHT_M
from modt.config.fields import StageConfig, choice, number, numbers

if TYPE_CHECKING:
    from modt.geometry.beams import Beams


DEFAULT_SPAN_DEG = -15.0, 15.0
"""Elevations of the lowest and the highest beam of a sensor whose profile has none."""
REFLECTANCE_SCALES = ("hdl-64e", "pandar64")
"""Sensors whose reflectance a model may have learnt."""


@dataclass(frozen=True, kw_only=True)
class SensorConfig(StageConfig):
    """Mount, range and resolution of the sensor."""

    height_m: float | None = number(
        1.73, 0.05, 5.0, "m", "Height of the sensor above the ground. Null: estimated from the first sweeps."
    )
    roll_deg: float | None = number(
        None, -180.0, 180.0, "deg", "Roll of the mount, left side up. Null: measured in the first sweep."
    )
    pitch_deg: float | None = number(
        None, -90.0, 90.0, "deg", "Pitch of the mount, nose down. Null: measured in the first sweep."
    )
    min_range_m: float = number(2.0, 0.0, 20.0, "m", "Nearer points are left out, as they may be the robot's own.")
    max_range_m: float = number(80.0, 1.0, 400.0, "m", "Farther points are left out.")
    elevation_step_deg: float = number(0.42, 0.01, 10.0, "deg", "Angle between neighbouring beams, evenly spaced.")
    elevations_deg: tuple[float, ...] | None = numbers(
        -90.0, 90.0, 512, "deg", "Elevation of every beam, in any order. Null: the beams are evenly spaced."
    )
    elevation_span_deg: tuple[float, ...] | None = numbers(
        -90.0, 90.0, 2, "deg", "Elevations of the lowest and the highest beam. Null: not known."
    )
    azimuth_step_deg: float = number(0.17, 0.01, 10.0, "deg", "Angle between neighbouring returns of a beam.")
    blind_sectors_deg: tuple[float, ...] | None = numbers(
        -360.0, 360.0, 64, "deg", "Sectors hidden by the robot, each from and to, counter-clockwise.", pairs=True
    )
    blind_range_m: float = number(3.0, 0.1, 20.0, "m", "Points in blind_sectors_deg up to this range are left out.")
    period_s: float = number(
        0.1, 0.001, 10.0, "s", "Time between two sweeps, for scans without time stamps and tracking.max_missed."
    )
    reflectance: str = choice(
        "none", ("none", *REFLECTANCE_SCALES), "Sensor whose scale the reflectance has. none: it is not used."
    )

    @property
    def span_deg(self) -> tuple[float, float] | None:
        """Elevations of the lowest and the highest beam; None if unknown."""
        beams = self.elevations_deg or self.elevation_span_deg
        return None if beams is None else (min(beams), max(beams))

    @property
    def assumed_span_deg(self) -> tuple[float, float]:
        """`span_deg`, or DEFAULT_SPAN_DEG if it is unknown."""
        return self.span_deg or DEFAULT_SPAN_DEG

    @property
    def rays_per_turn(self) -> float:
        """Number of rays in a turn."""
        if self.elevations_deg is not None:
            beams = float(len(self.elevations_deg))
        else:
            low_deg, high_deg = self.assumed_span_deg
            beams = (high_deg - low_deg) / self.elevation_step_deg + 1
        return beams * 360 / self.azimuth_step_deg

    @property
    def beam_elevations_deg(self) -> tuple[float, ...]:
        """Elevation of every beam, ascending; none if they are not known."""
        if self.elevations_deg is not None:
            return tuple(sorted(self.elevations_deg))
        if self.elevation_span_deg is None:
            return ()
        low_deg, high_deg = self.elevation_span_deg
        steps = max(round((high_deg - low_deg) / self.elevation_step_deg), 1)
        return tuple(low_deg + k * (high_deg - low_deg) / steps for k in range(steps + 1))

    @property
    def person_seen_from_m(self) -> float | None:
        """Distance from which half of a person is in view [m]; None if the mount or the beams are unknown."""
        if self.height_m is None or self.span_deg is None:
            return None
        low, high = (math.tan(math.radians(deg)) for deg in self.span_deg)
        for decimetres in range(1, 201):
            distance_m = decimetres / 10
            top_m = min(self.height_m + distance_m * high, PERSON_HEIGHT_M)
            bottom_m = max(self.height_m + distance_m * low, 0.0)
            if top_m - bottom_m >= PERSON_HEIGHT_M / 2:
                return distance_m
        return None

    @property
    def beams(self) -> Beams:
        """Spacing of the beams."""
        from modt.geometry.beams import beams_of  # NumPy, which commands import after they are pinned

        return beams_of(self.elevations_deg, self.elevation_step_deg)
