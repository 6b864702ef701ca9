"""The whole profile."""

from __future__ import annotations

from dataclasses import dataclass, field

from modt.config.base import ValueRangeError
from modt.config.classification import ClassificationConfig, DecisionConfig, FusionConfig, SchedulerConfig
from modt.config.energy import EnergyConfig
from modt.config.odometry import OdometryConfig
from modt.config.segmentation import SegmentationConfig
from modt.config.sensor import SensorConfig
from modt.config.service import LoopConfig, RecordingConfig
from modt.config.tracking import TrackingConfig


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
