"""Configuration: one frozen dataclass a stage, whose values are checked as it is made."""

from modt.config.base import StageConfig, ValueRangeError
from modt.config.classification import (
    ClassificationConfig,
    DecisionConfig,
    FusionConfig,
    SchedulerConfig,
)
from modt.config.odometry import OdometryConfig
from modt.config.profile import EnergyConfig, LoopConfig, ProfileConfig, RecordingConfig, SensorConfig
from modt.config.segmentation import SegmentationConfig
from modt.config.tracking import (
    PaperAssociationConfig,
    TrackingConfig,
)

__all__ = [
    "ClassificationConfig",
    "DecisionConfig",
    "EnergyConfig",
    "FusionConfig",
    "LoopConfig",
    "OdometryConfig",
    "PaperAssociationConfig",
    "ProfileConfig",
    "RecordingConfig",
    "SchedulerConfig",
    "SegmentationConfig",
    "SensorConfig",
    "StageConfig",
    "TrackingConfig",
    "ValueRangeError",
]
