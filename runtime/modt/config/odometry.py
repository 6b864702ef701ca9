"""Poses that another program sends."""

from __future__ import annotations

from dataclasses import dataclass

from modt.config.base import StageConfig, number


@dataclass(frozen=True, slots=True, kw_only=True)
class OdometryConfig(StageConfig):
    """Poses received by a socket, in effect with `--odometry udp://` and `unix://`."""

    max_speed_mps: float = number(60.0, 0.1, 1000.0, "m/s", "of the sensor; beyond it the sender has restarted")
