"""The sensor."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from modt.config.base import StageConfig, choice, number, numbers

if TYPE_CHECKING:
    from modt.geometry.beams import Beams

REFLECTANCE_SCALES = ("hdl-64e", "pandar64")
"""Sensors whose reflectance a model may have learnt."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SensorConfig(StageConfig):
    """Mount, range and resolution of the sensor."""

    height_m: float | None = number(1.73, 0.05, 5.0, "m", "above the ground; null: estimated from the stream")
    min_range_m: float = number(2.0, 0.0, 20.0, "m", "of the points used; nearer ones are on the robot itself")
    max_range_m: float = number(80.0, 1.0, 400.0, "m", "of the points used")
    elevation_step_deg: float = number(0.42, 0.01, 10.0, "deg", "between neighbouring beams that are evenly spaced")
    elevations_deg: tuple[float, ...] | None = numbers(
        -90.0, 90.0, 512, "deg", "of all beams, in any order; null: evenly spaced"
    )
    azimuth_step_deg: float = number(0.17, 0.01, 10.0, "deg", "between neighbouring returns of a beam")
    blind_sectors_deg: tuple[float, ...] | None = numbers(
        -360.0, 360.0, 64, "deg", "from, to of each, counter-clockwise: onto the robot", pairs=True
    )
    blind_range_m: float = number(3.0, 0.1, 20.0, "m", "of returns left out in these sectors, at most")
    period_s: float = number(0.1, 0.001, 10.0, "s", "between sweeps, of folders without stamps and of max_missed")
    reflectance: str = choice(
        "none", ("none", *REFLECTANCE_SCALES), "scale; models use only those they learnt; none: not used"
    )

    @property
    def beams(self) -> Beams:
        """Spacing of the beams."""
        from modt.geometry.beams import BeamTable, EvenBeams  # NumPy, which commands import after they are pinned

        if self.elevations_deg is None:
            return EvenBeams(self.elevation_step_deg)
        return BeamTable(self.elevations_deg)
