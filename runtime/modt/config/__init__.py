"""Configuration: one frozen dataclass a stage, whose values are checked as it is made."""

from modt.config.base import StageConfig, ValueRangeError
from modt.config.profile import EnergyConfig, LoopConfig, ProfileConfig, RecordingConfig, SensorConfig
from modt.config.stages import (
    ClassificationConfig,
    DecisionConfig,
    FusionConfig,
    OdometryConfig,
    SchedulerConfig,
    SegmentationConfig,
    TrackingConfig,
)

__all__ = [
    "ClassificationConfig",
    "DecisionConfig",
    "EnergyConfig",
    "FusionConfig",
    "LoopConfig",
    "OdometryConfig",
    "ProfileConfig",
    "RecordingConfig",
    "SchedulerConfig",
    "SegmentationConfig",
    "SensorConfig",
    "StageConfig",
    "TrackingConfig",
    "ValueRangeError",
]
