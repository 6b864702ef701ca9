"""A profile: sensor, board, live loop and all stages."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from modt.classes import PERSON_M
from modt.config.base import StageConfig, ValueRangeError, choice, number, numbers
from modt.config.stages import (
    ClassificationConfig,
    DecisionConfig,
    FusionConfig,
    OdometryConfig,
    SchedulerConfig,
    SegmentationConfig,
    TrackingConfig,
)

if TYPE_CHECKING:
    from modt.geometry.beams import Beams

GRID_CELLS, MAX_CELLS = 200, 5e7
"""Cells of both grids of the segmentation per metre of range at a cell of 1 m, and greatest number (200 MB)."""
REFLECTANCE_SCALES = ("hdl-64e", "pandar64")
"""Sensors whose reflectance a model may have learnt."""


@dataclass(frozen=True, slots=True, kw_only=True)
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
    min_range_m: float = number(2.0, 0.0, 20.0, "m", "Nearer points are left out, as they are on the robot.")
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
    def person_seen_from_m(self) -> float | None:
        """Distance from which a third of a person is in view [m]; None if the mount or the beams are unknown."""
        if self.height_m is None or self.span_deg is None:
            return None
        h, (low, high) = self.height_m, (math.tan(math.radians(deg)) for deg in self.span_deg)
        seen = ((d / 10, min(h + d / 10 * high, PERSON_M) - max(h + d / 10 * low, 0.0)) for d in range(1, 201))
        return next((d for d, seen_m in seen if seen_m >= PERSON_M / 3), None)

    @property
    def beams(self) -> Beams:
        """Spacing of the beams."""
        from modt.geometry.beams import BeamTable, EvenBeams  # NumPy, which commands import after they are pinned

        if self.elevations_deg is None:
            return EvenBeams(self.elevation_step_deg)
        return BeamTable(self.elevations_deg)


@dataclass(frozen=True, slots=True, kw_only=True)
class EnergyConfig(StageConfig):
    """Power of the board where no meter is read, and the coefficients that `modt-profile calibrate` finds.

    Energy of a window = idle_W x time + seg_J x segmentations + class_J x classifications + point_J x points.
    """

    board: str = field(default="unknown", metadata={"meaning": "Name of the board in reports."})
    idle_W: float = number(3.0, 0.0, 1000.0, "W", "Power of the board while modt waits.")
    busy_W: float = number(7.0, 0.0, 1000.0, "W", "Power of the board while modt computes on one core.")
    meter: str = field(default="none", metadata={"meaning": "Meter of the calibration."})
    seg_J: float | None = number(None, -1000.0, 1000.0, "J", "Energy of one segmentation. Null: not calibrated.")
    class_J: float | None = number(
        None, -1000.0, 1000.0, "J", "Energy of one classification, without its points. Null: not calibrated."
    )
    point_J: float | None = number(
        None, -1000.0, 1000.0, "J", "Energy of one point that is classified. Null: not calibrated."
    )

    @property
    def active_W(self) -> float:
        """Power of one busy core beyond idle [W], equal to mJ/ms."""
        return self.busy_W - self.idle_W

    @property
    def coefficients(self) -> tuple[float, float, float] | None:
        """seg_J, class_J and point_J of a calibration; None unless all three are set."""
        if self.seg_J is None or self.class_J is None or self.point_J is None:
            return None
        return self.seg_J, self.class_J, self.point_J


@dataclass(frozen=True, slots=True, kw_only=True)
class LoopConfig(StageConfig):
    """Limit of the live loop, in effect with `modt run`."""

    power_W: float | None = number(
        None, 0.01, 1000.0, "W", "Power of the board above which the loop sheds load. Null: no limit."
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class RecordingConfig(StageConfig):
    """Records of the live loop, in effect with `modt run`."""

    keep: str = choice(
        "all", ("all", "tracks", "ledger", "none"), "Records that are written: tracks, ledger, both or none."
    )
    disk_mb: float = number(2000.0, 1.0, 1e7, "MB", "Size of all records together. The oldest are deleted.")
    gb_per_day: float = number(
        10.0, 0.01, 1e5, "GB", "Size of the tracks of a day, after the first 0.5 GB. Frames beyond it are left out."
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class ProfileConfig:
    """The whole configuration: a sensor, a board and all stages, as profiles describe them."""

    sensor: SensorConfig = field(default_factory=SensorConfig)
    segmentation: SegmentationConfig = field(default_factory=SegmentationConfig)
    tracking: TrackingConfig = field(default_factory=TrackingConfig)
    classification: ClassificationConfig = field(default_factory=ClassificationConfig)
    scheduler: SchedulerConfig = field(default_factory=SchedulerConfig)
    fusion: FusionConfig = field(default_factory=FusionConfig)
    decision: DecisionConfig = field(default_factory=DecisionConfig)
    odometry: OdometryConfig = field(default_factory=OdometryConfig)
    energy: EnergyConfig = field(default_factory=EnergyConfig)
    loop: LoopConfig = field(default_factory=LoopConfig)
    recording: RecordingConfig = field(default_factory=RecordingConfig)

    def __post_init__(self) -> None:
        cells = GRID_CELLS * self.sensor.max_range_m / self.segmentation.cell_m**2
        if cells > MAX_CELLS:
            cause = f"{self.segmentation.cell_m:g} m takes {cells / 1e6:.0f} million cells at this sensor.max_range_m"
            least_m = (GRID_CELLS * self.sensor.max_range_m / MAX_CELLS) ** 0.5
            raise ValueRangeError("segmentation.cell_m", cause, f"give at least {least_m:.3f} m, or a shorter range")
        if self.scheduler.energy_mJ_per_frame is not None and self.energy.active_W <= 0:
            raise ValueRangeError(
                "scheduler.energy_mJ_per_frame",
                "buys any number of calls, since energy.busy_W is not above energy.idle_W",
                "calibrate the board (modt-profile calibrate) or state both powers",
            )

    @property
    def classification_ms(self) -> float | None:
        """CPU time that a frame may spend on classification [ms], the smaller of both budgets; None without one."""
        stage = self.scheduler
        by_energy = stage.energy_mJ_per_frame
        limits = [stage.cpu_ms_per_frame, None if by_energy is None else by_energy / self.energy.active_W]
        return min((limit for limit in limits if limit is not None), default=None)
