"""Tracking of the boxes of another detector."""

from __future__ import annotations

from dataclasses import dataclass

from modt.classes import ObjectClass
from modt.config.base import StageConfig, mechanism, number


@dataclass(frozen=True, slots=True, kw_only=True)
class BoxFilterConfig(StageConfig):
    """Motion and measurement model of a box; the defaults are tuned on PointRCNN's KITTI detections."""

    position_sigma_m: float = number(0.2, 0.01, 5.0, "m", "of a detected centre of score zero")
    score_scale: float = number(10.0, 0.1, 1e6, "", "increase of the score that divides that sigma by e")
    acceleration_sigma_mps2: float = number(10.0, 0.01, 50.0, "m/s2", "process noise, with the sensor's own motion")
    initial_speed_sigma_mps: float = number(10.0, 0.1, 50.0, "m/s", "of a new track, along each axis")
    size_gain: float = number(0.3, 0.0, 1.0, "", "least weight of a new measurement of the size")
    height_gain: float = number(0.7, 0.0, 1.0, "", "weight of a new measurement of the height of the centre")
    yaw_gain: float = number(0.7, 0.0, 1.0, "", "weight of a new measurement of the yaw")


@dataclass(frozen=True, slots=True, kw_only=True)
class BoxAssociationConfig(StageConfig):
    """Cost of a pair of a track and a detection, 1 at the edge of the gate."""

    gate: float = number(13.8, 0.1, 1000.0, "", "squared Mahalanobis distance at most, 0.999 quantile of chi2(2)")
    length_share: float = number(0.7, 0.0, 2.0, "", "share of the track's length added to the gate's radius")
    height_weight_per_m: float = number(0.2, 0.0, 10.0, "1/m", "weight of the difference of height")
    yaw_weight: float = number(0.1, 0.0, 10.0, "", "weight of the absolute sine of the difference of yaw")


@dataclass(frozen=True, slots=True, kw_only=True)
class BoxConfidenceConfig(StageConfig):
    """Confidence in a track: its smoothed score, raised by range and age."""

    report_above: float = number(6.5, -1e3, 1e3, "", "least confidence of a track in a frame in which it is reported")
    keep_above: float = number(8.5, -1e3, 1e3, "", "least mean confidence of a track that is written")
    range_bonus_per_m: float = number(0.1, 0.0, 10.0, "1/m", "added to the score of a detection per metre of range")
    age_bonus: float = number(0.5, 0.0, 10.0, "", "added per unit of the logarithm of the number of detections")
    score_gain: float = number(0.5, 0.0, 1.0, "", "least weight of a new detection's score")


@dataclass(frozen=True, slots=True, kw_only=True)
class BoxTrackingConfig(StageConfig):
    """Tracking of the boxes of one class."""

    min_birth_score: float = number(0.0, -1e3, 1e3, "", "least score of a detection that starts a track")
    max_missed: int = number(30, 0, 100, "frames", "without a detection after which a track is deleted")
    max_gap: int = number(3, 0, 100, "frames", "without a report that are filled afterwards")
    filter: BoxFilterConfig = mechanism(BoxFilterConfig)
    association: BoxAssociationConfig = mechanism(BoxAssociationConfig)
    confidence: BoxConfidenceConfig = mechanism(BoxConfidenceConfig)


BOX_TRACKING = {
    ObjectClass.PEDESTRIAN: BoxTrackingConfig(
        max_gap=1,
        filter=BoxFilterConfig(yaw_gain=0.5),
        confidence=BoxConfidenceConfig(report_above=1.0, keep_above=3.8, range_bonus_per_m=0.0),
    ),
    ObjectClass.CYCLIST: BoxTrackingConfig(
        confidence=BoxConfidenceConfig(report_above=1.0, keep_above=4.2, range_bonus_per_m=0.0)
    ),
}
"""Configuration of the classes that differ from the default, tuned on PointRCNN's KITTI detections."""


def box_tracking_config(object_class: ObjectClass) -> BoxTrackingConfig:
    """Configuration of a class, the default where it has none of its own."""
    return BOX_TRACKING.get(object_class, BoxTrackingConfig())
