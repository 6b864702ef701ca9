"""Poses."""

from __future__ import annotations

from dataclasses import dataclass

from modt.config.base import StageConfig, mechanism, number
from modt.config.registration import LandmarkConfig, RegistrationConfig


@dataclass(frozen=True, slots=True, kw_only=True)
class OdometryConfig(StageConfig):
    """Poses received by a socket."""

    max_age_s: float = number(0.3, 0.001, 10.0, "s", "greatest distance in time of a frame from its poses")
    max_ahead_s: float = number(
        60.0, 0.1, 3600.0, "s", "greatest lead of a pose over its frame; a greater one means another clock"
    )
    max_speed_mps: float = number(
        60.0, 0.1, 1000.0, "m/s", "of the sensor; a greater speed between poses means that the sender has restarted"
    )
    position_noise_m: float = number(
        0.5, 0.0, 10.0, "m", "distance between two poses that counts as noise, not as speed"
    )
    capacity: int = number(256, 2, 65536, "", "poses kept, and datagrams read per frame at most")
    registration: RegistrationConfig = mechanism(RegistrationConfig)
    landmarks: LandmarkConfig = mechanism(LandmarkConfig)
