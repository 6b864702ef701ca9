"""Poses."""

from __future__ import annotations

from dataclasses import dataclass

from modt.config.base import StageConfig, mechanism, number
from modt.config.registration import LandmarkConfig, RegistrationConfig


@dataclass(frozen=True, slots=True, kw_only=True)
class OdometryConfig(StageConfig):
    """Poses that come in by a socket."""

    max_age_s: float = number(0.3, 0.001, 10.0, "s", "from a pose, beyond which it says nothing")
    max_ahead_s: float = number(60.0, 0.1, 3600.0, "s", "of a pose before its frame; more is another clock")
    max_speed_mps: float = number(60.0, 0.1, 1000.0, "m/s", "of the sensor; poses farther apart: a sender begun anew")
    capacity: int = number(256, 2, 65536, "", "poses kept, and taken in one frame at most")
    registration: RegistrationConfig = mechanism(RegistrationConfig)
    landmarks: LandmarkConfig = mechanism(LandmarkConfig)
