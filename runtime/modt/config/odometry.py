"""Poses, given or by registration of a sweep against landmarks; settled on synthetic drives."""

from __future__ import annotations

from dataclasses import dataclass

from modt.config.base import StageConfig, mechanism, number


@dataclass(frozen=True, slots=True, kw_only=True)
class LandmarkConfig(StageConfig):
    """Mean k-DOPs of stationary objects."""

    min_frames: int = number(3, 1, 1000, "frames", "at rest, from which the mean is the landmark's position")
    min_gain: float = number(0.03, 0.001, 1.0, "", "least weight of a new view in the mean")
    max_jump_m: float = number(0.2, 0.01, 5.0, "m", "of an end of a k-DOP; beyond it the mean of that end restarts")


@dataclass(frozen=True, slots=True, kw_only=True)
class RegistrationConfig(StageConfig):
    """Planar motion that brings a sweep onto the landmarks."""

    reach_m: float = number(2.5, 0.1, 20.0, "m", "error of the first prediction at most; greatest correction")
    gate_m: float = number(0.8, 0.05, 20.0, "m", "error of a prediction once the motion is known")
    max_turn_rad: float = number(0.2, 0.01, 1.5, "rad", "greatest turn of a correction")
    vote_cell_m: float = number(0.25, 0.02, 5.0, "m", "side of a cell of the vote on the first displacement")
    max_size_difference: float = number(0.5, 0.01, 5.0, "", "of log sizes, beyond which a pair has no vote")
    end_sigma_m: float = number(0.02, 0.001, 1.0, "m", "scale of the error of an end of a k-DOP, at range 0")
    end_sigma_per_m: float = number(0.0007, 0.0, 0.1, "", "its growth with range")
    young_sigma_m: float = number(0.07, 0.0, 1.0, "m", "the same besides, of a landmark without an established mean")
    inlier_m: float = number(0.2, 0.01, 5.0, "m", "distance to its landmark within which an observation agrees")
    min_agreement: float = number(0.3, 0.0, 1.0, "", "share of inliers from which the motion counts as known")
    inlier_ratio: float = number(0.75, 0.0, 1.0, "", "share of inliers below which pairs are sought farther away")
    inlier_drop: float = number(0.5, 0.0, 1.0, "", "share of the last frame's inliers below which the same is done")
    initial_turn_rad: float = number(
        0.05, 0.0, 1.0, "rad", "of the turns tried while no motion is known, three to either side"
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class OdometryConfig(StageConfig):
    """Poses received by a socket."""

    max_speed_mps: float = number(60.0, 0.1, 1000.0, "m/s", "of the sensor; beyond it the sender has restarted")
    registration: RegistrationConfig = mechanism(RegistrationConfig)
    landmarks: LandmarkConfig = mechanism(LandmarkConfig)
