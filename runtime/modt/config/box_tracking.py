"""Tracking of the boxes of another detector."""

from __future__ import annotations

from dataclasses import dataclass

from modt.config.base import StageConfig, number


@dataclass(frozen=True, slots=True, kw_only=True)
class BoxTrackingConfig(StageConfig):
    """Tracking of whole boxes that another detector has found, one class at a time."""

    strong_score: float = number(
        0.0, -1e3, 1e3, "", "detections of this score begin a track; weaker ones continue one"
    )
    sure: float = number(6.5, -1e3, 1e3, "", "confidence from which a track is reported")
    range_bonus_per_m: float = number(0.1, 0.0, 10.0, "1/m", "what a detection's confidence gains with range")
    age_bonus: float = number(0.5, 0.0, 10.0, "", "what a track's confidence gains with the logarithm of its age")
    score_gain: float = number(0.5, 0.0, 1.0, "", "least weight of a new detection in the confidence")
    max_missed: int = number(8, 0, 100, "frames", "without a detection before a track is deleted")
    report_missed: int = number(0, 0, 100, "frames", "for which a track is reported where it is predicted")
    gate: float = number(13.8, 0.1, 1000.0, "", "squared Mahalanobis distance of an association at most")
    overlap: float = number(0.7, 0.0, 2.0, "", "part of the length by which a centre may be off besides")
    position_sigma_m: float = number(0.2, 0.01, 5.0, "m", "of a detected centre of score zero")
    score_scale: float = number(10.0, 0.1, 1e6, "", "rise of the score that makes a centre e times as exact")
    acceleration_sigma_mps2: float = number(10.0, 0.01, 50.0, "m/s2", "process noise, the sensor's own included")
    initial_speed_sigma_mps: float = number(20.0, 0.1, 50.0, "m/s", "of a new track, along each axis")
    smoothing: float = number(0.3, 0.0, 1.0, "", "least weight of a new measurement of the size")
    height_gain: float = number(0.7, 0.0, 1.0, "", "weight of a new measurement of the height")
    turn_gain: float = number(0.7, 0.0, 1.0, "", "weight of a new measurement of the heading")
