"""Poses that another program sends."""

from __future__ import annotations

from dataclasses import dataclass

from modt.config.base import StageConfig, number


@dataclass(frozen=True, slots=True, kw_only=True)
class OdometryConfig(StageConfig):
    """Poses received by a socket, in effect with `--odometry udp://` and `unix://`."""

    max_age_s: float = number(0.3, 0.001, 10.0, "s", "greatest distance in time of a frame from its poses")
    max_ahead_s: float = number(60.0, 0.1, 3600.0, "s", "greatest lead of a pose over its frame by the same clock")
    max_speed_mps: float = number(60.0, 0.1, 1000.0, "m/s", "of the sensor; beyond it the sender has restarted")
    max_acceleration_mps2: float = number(10.0, 0.1, 1000.0, "m/s2", "of the sensor; beyond it a pose is doubted")
    confirm_s: float = number(0.2, 0.01, 1.0, "s", "that doubted poses must continue one another, to be believed")
    position_noise_m: float = number(0.5, 0.0, 10.0, "m", "distance between two poses that is noise, not speed")
    capacity: int = number(256, 2, 65536, "", "poses kept, and datagrams of a frame at most, the newest")
