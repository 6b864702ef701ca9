"""Configuration: one frozen dataclass a stage, every value bounded and checked as it is made.

Defaults of the segmentation without another source were chosen on labelled KITTI scans (docs/evaluation.md).
"""

from __future__ import annotations

from modt.config.classification import ClassificationConfig, SchedulerConfig
from modt.config.energy import EnergyConfig
from modt.config.fields import StageConfig, ValueRangeError, check, completed
from modt.config.fusion import DecisionConfig, FusionConfig
from modt.config.live import LoopConfig, RecordingConfig, TrustConfig
from modt.config.mounted_sensor import MountedSensor
from modt.config.odometry import OdometryConfig
from modt.config.profile import ProfileConfig
from modt.config.read_sensor import ReadSensor
from modt.config.segmentation import KERNELS, NATIVE, NUMPY, SegmentationConfig
from modt.config.sensor import REFLECTANCE_SCALES, SensorConfig
from modt.config.tracking import TrackingConfig

__all__ = [
    "KERNELS",
    "NATIVE",
    "NUMPY",
    "REFLECTANCE_SCALES",
    "ClassificationConfig",
    "DecisionConfig",
    "EnergyConfig",
    "FusionConfig",
    "LoopConfig",
    "MountedSensor",
    "OdometryConfig",
    "ProfileConfig",
    "ReadSensor",
    "RecordingConfig",
    "SchedulerConfig",
    "SegmentationConfig",
    "SensorConfig",
    "StageConfig",
    "TrackingConfig",
    "TrustConfig",
    "ValueRangeError",
    "check",
    "completed",
]
