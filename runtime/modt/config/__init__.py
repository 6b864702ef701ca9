"""Configuration: one frozen dataclass a stage, one nested in it a mechanism; every value is checked as it is made."""

from modt.config.base import StageConfig, ValueRangeError
from modt.config.classification import (
    CallWorthConfig,
    ClassificationConfig,
    CostModelConfig,
    DecisionConfig,
    FusionConfig,
    SchedulerConfig,
)
from modt.config.odometry import LandmarkConfig, OdometryConfig, RegistrationConfig
from modt.config.profile import EnergyConfig, LoopConfig, ProfileConfig, RecordingConfig, SensorConfig, WindowConfig
from modt.config.segmentation import SegmentationConfig
from modt.config.tracking import (
    PaperAssociationConfig,
    TrackingConfig,
)

__all__ = [
    "CallWorthConfig",
    "ClassificationConfig",
    "CostModelConfig",
    "DecisionConfig",
    "EnergyConfig",
    "FusionConfig",
    "LandmarkConfig",
    "LoopConfig",
    "OdometryConfig",
    "PaperAssociationConfig",
    "ProfileConfig",
    "RecordingConfig",
    "RegistrationConfig",
    "SchedulerConfig",
    "SegmentationConfig",
    "SensorConfig",
    "StageConfig",
    "TrackingConfig",
    "ValueRangeError",
    "WindowConfig",
]
