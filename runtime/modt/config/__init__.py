"""Configuration: one frozen dataclass a stage, one nested in it a mechanism; every value is checked as it is made."""

from modt.config.base import StageConfig, ValueRangeError
from modt.config.classification import (
    ClassificationConfig,
    DecisionConfig,
    FusionConfig,
    SchedulerConfig,
)
from modt.config.odometry import LandmarkConfig, OdometryConfig, RegistrationConfig
from modt.config.profile import EnergyConfig, LoopConfig, ProfileConfig, RecordingConfig, SensorConfig, WindowConfig
from modt.config.segmentation import SegmentationConfig
from modt.config.tracking import (
    BackgroundMapConfig,
    FilterConfig,
    FragmentConfig,
    KdopAssociationConfig,
    MergeConfig,
    PaperAssociationConfig,
    SplitConfig,
    TrackingConfig,
)

__all__ = [
    "BackgroundMapConfig",
    "ClassificationConfig",
    "DecisionConfig",
    "EnergyConfig",
    "FilterConfig",
    "FragmentConfig",
    "FusionConfig",
    "KdopAssociationConfig",
    "LandmarkConfig",
    "LoopConfig",
    "MergeConfig",
    "OdometryConfig",
    "PaperAssociationConfig",
    "ProfileConfig",
    "RecordingConfig",
    "RegistrationConfig",
    "SchedulerConfig",
    "SegmentationConfig",
    "SensorConfig",
    "SplitConfig",
    "StageConfig",
    "TrackingConfig",
    "ValueRangeError",
    "WindowConfig",
]
