"""Configuration of the odometry."""

from __future__ import annotations

from dataclasses import dataclass

from modt.config.fields import StageConfig, number


@dataclass(frozen=True, kw_only=True)
class OdometryConfig(StageConfig):
    """Poses from another program, in effect with `--odometry udp://`, `unix://` and `ros2://`."""

    max_speed_mps: float = number(
        60.0, 0.1, 1000.0, "m/s", "Greatest speed of the sensor. A faster jump means a restarted sender."
    )
