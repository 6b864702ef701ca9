"""A profile: sensor, board, live loop and all stages, and the list of its keys."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field, fields
from typing import TYPE_CHECKING, Any

from modt.classes import PERSON_M
from modt.config.base import StageConfig, ValueRangeError, choice, mechanism, number, numbers
from modt.config.classification import ClassificationConfig, DecisionConfig, FusionConfig, SchedulerConfig
from modt.config.odometry import OdometryConfig
from modt.config.segmentation import SegmentationConfig
from modt.config.tracking import TrackingConfig

if TYPE_CHECKING:
    from modt.geometry.beams import Beams

GRID_CELLS, MAX_CELLS = 200, 5e7
"""Cells of both grids of the segmentation for each m of range and 1/m2 of cell_m, and most of them: 200 MB."""
REFLECTANCE_SCALES = ("hdl-64e", "pandar64")
"""Sensors whose reflectance a model may have learnt."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SensorConfig(StageConfig):
    """Mount, range and resolution of the sensor."""

    height_m: float | None = number(1.73, 0.05, 5.0, "m", "above the ground; null: estimated from the stream")
    roll_deg: float | None = number(
        None,
        -180.0,
        180.0,
        "deg",
        "of the mount, left side up; null: by the first sweep, where it is tilted by 2 or more",
    )
    pitch_deg: float | None = number(None, -90.0, 90.0, "deg", "of the mount, nose down; null: likewise")
    min_range_m: float = number(2.0, 0.0, 20.0, "m", "of the points used; nearer ones are on the robot itself")
    max_range_m: float = number(80.0, 1.0, 400.0, "m", "of the points used")
    elevation_step_deg: float = number(0.42, 0.01, 10.0, "deg", "between neighbouring beams that are evenly spaced")
    elevations_deg: tuple[float, ...] | None = numbers(
        -90.0, 90.0, 512, "deg", "of all beams, in any order; null: evenly spaced"
    )
    elevation_span_deg: tuple[float, ...] | None = numbers(
        -90.0, 90.0, 2, "deg", "lowest, highest beam; null: unknown"
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
    def span_deg(self) -> tuple[float, float] | None:
        """Elevations of the lowest and the highest beam; None where they are not known."""
        beams = self.elevations_deg or self.elevation_span_deg
        return None if beams is None else (min(beams), max(beams))

    @property
    def person_seen_from_m(self) -> float | None:
        """Distance from which a third of a person is in view [m]; None where mount or beams are not known."""
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
class WindowConfig(StageConfig):
    """Windows between readings of the meters."""

    min_s: float = number(1.0, 0.001, 1e9, "s", "shortest window; RAPL steps in ms, INA chips and batteries average")
    suspend_s: float = number(0.2, 0.001, 60.0, "s", "lead of the boot clock that counts as suspension")
    clock_step_s: float = number(0.5, 0.001, 3600.0, "s", "step of the calendar clock that is marked")


@dataclass(frozen=True, slots=True, kw_only=True)
class EnergyConfig(StageConfig):
    """Power of the board where it is not measured, and the coefficients of its calibration.

    The coefficients are those of a fit over windows: energy = idle_W x time + seg_J x segmentations + class_J x
    classifications + point_J x points classified.
    """

    board: str = field(default="unknown", metadata={"meaning": "name of the board"})
    idle_W: float = number(3.0, 0.0, 1000.0, "W", "power while the process waits")
    busy_W: float = number(7.0, 0.0, 1000.0, "W", "power while it computes on one core")
    meter: str = field(default="none", metadata={"meaning": "meter of the calibration"})
    seg_J: float | None = number(None, -1000.0, 1000.0, "J", "energy of one segmentation")
    class_J: float | None = number(None, -1000.0, 1000.0, "J", "energy of one classification")
    point_J: float | None = number(None, -1000.0, 1000.0, "J", "energy of one point classified")
    windows: WindowConfig = mechanism(WindowConfig)

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
    """Limits that the loop of a live source keeps to."""

    power_W: float | None = number(
        None, 0.01, 1000.0, "W", "limit of the board's power, by its meter or else its model; null: none"
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class RecordingConfig(StageConfig):
    """Records of a live source."""

    keep: str = choice("all", ("all", "tracks", "ledger", "none"), "which records are written")
    disk_mb: float = number(
        2000.0, 1.0, 1e7, "MB", "of the records of this run and earlier ones; the oldest are deleted"
    )
    gb_per_day: float = number(
        10.0,
        0.01,
        1e5,
        "GB",
        "written to the disk by the tracks, after the first 0.5 GB; frames beyond it are left out",
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class ProfileConfig:
    """All of it: a sensor and a board, as a profile file describes them."""

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
        """CPU time that a frame may spend on classification [ms]: what its time and its energy allow."""
        stage = self.scheduler
        by_energy = stage.energy_mJ_per_frame
        limits = [stage.cpu_ms_per_frame, None if by_energy is None else by_energy / self.energy.active_W]
        return min((limit for limit in limits if limit is not None), default=None)


@dataclass(frozen=True, slots=True)
class Key:
    """One key of a profile.

    Attributes:
        path: of the key, with dots.
        default: without a profile.
        kind: type of its values.
        facts: low, high, unit, options, number of values and meaning.
    """

    path: str
    default: Any
    kind: str
    facts: dict[str, Any]

    @property
    def bounds(self) -> str:
        """Bounds and unit, or options."""
        if "options" in self.facts:
            return ", ".join(self.facts["options"])
        if "low" not in self.facts:
            return "text"
        bounds = f"{self.facts['low']:g} to {self.facts['high']:g} {self.facts.get('unit', '')}".strip()
        return f"{bounds}, or null" if self.nullable else bounds

    @property
    def nullable(self) -> bool:
        """Whether null is a value."""
        return "None" in self.kind

    @property
    def whole(self) -> bool:
        """Whether its numbers are integers."""
        return self.kind.startswith("int")


def keys(config: type[StageConfig] | type[ProfileConfig] = ProfileConfig, prefix: str = "") -> Iterator[Key]:
    """Every key, in the order of the configuration."""
    for f in fields(config):
        kind = f.default_factory
        if isinstance(kind, type) and issubclass(kind, StageConfig):
            yield from keys(kind, f"{prefix}{f.name}.")
        else:
            yield Key(f"{prefix}{f.name}", f.default, str(f.type), dict(f.metadata))


def value_of(config: StageConfig | ProfileConfig, path: str) -> Any:
    """Value of a key."""
    value: Any = config
    for name in path.split("."):
        value = getattr(value, name)
    return value
