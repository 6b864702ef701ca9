"""The whole configuration, as a profile describes it."""

from __future__ import annotations

from dataclasses import dataclass, field

from modt.config.classification import ClassificationConfig, SchedulerConfig
from modt.config.energy import EnergyConfig
from modt.config.fields import ValueRangeError
from modt.config.fusion import DecisionConfig, FusionConfig
from modt.config.live import LoopConfig, RecordingConfig, TrustConfig
from modt.config.mounted_sensor import MountedSensor
from modt.config.odometry import OdometryConfig
from modt.config.segmentation import SegmentationConfig
from modt.config.sensor import SensorConfig
from modt.config.tracking import TrackingConfig

GRID_CELLS = 200
"""Cells of both grids of the segmentation per metre of range, at a cell of 1 m."""
MAX_CELLS = 5e7
"""Greatest number of cells of both grids (200 MB)."""


@dataclass(frozen=True, kw_only=True)
class ProfileConfig:
    """The whole configuration: a sensor, a board and all stages, as profiles describe them.

    With `sensors`, the sections `sensor` and `segmentation` are those of the first of them.
    """

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
    trust: TrustConfig = field(default_factory=TrustConfig)
    recording: RecordingConfig = field(default_factory=RecordingConfig)
    sensors: tuple[MountedSensor, ...] = ()

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
