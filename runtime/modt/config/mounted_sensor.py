"""One of several sensors of a robot."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

from modt.config.fields import StageConfig, ValueRangeError, vector
from modt.config.sensor import SensorConfig

if TYPE_CHECKING:
    from modt.types import Float64


@dataclass(frozen=True, kw_only=True)
class MountedSensor(StageConfig):
    """One of several sensors of a robot, whose frame has x forward, y left, z up, and its origin on the ground."""

    name: str = field(metadata={"meaning": "Its key in the section."})
    profile: str = field(default="", metadata={"meaning": "Name or file of its profile."})
    source: str = field(
        default="",
        metadata={"meaning": "Address of the sensor; in a recording its topic or port; or a recording of its own."},
    )
    position_m: tuple[float, ...] = vector(
        (0.0, 0.0, 0.0), 30.0, "m", "Place of the sensor on the robot: x, y, and height above the ground."
    )
    roll_pitch_yaw_deg: tuple[float, ...] = vector(
        (0.0, 0.0, 0.0), 360.0, "deg", "Turns of the sensor on the robot: left side up, nose down, counter-clockwise."
    )

    def __post_init__(self) -> None:
        StageConfig.__post_init__(self)
        if not self.profile:
            raise ValueRangeError("profile", "is missing", "name the profile of this sensor")
        SensorConfig(height_m=self.position_m[2])

    def mounted(self, sensor: SensorConfig) -> SensorConfig:
        """The sensor of its profile, with this mount."""
        roll_deg, pitch_deg, _ = self.roll_pitch_yaw_deg
        return replace(sensor, height_m=self.position_m[2], roll_deg=roll_deg, pitch_deg=pitch_deg)

    @property
    def T_robot_sensor(self) -> Float64:
        """(4, 4) pose of the sensor on the robot."""
        from modt.placement import mount_pose  # NumPy, as for `beams`

        return mount_pose(self.position_m, self.roll_pitch_yaw_deg)

    @property
    def T_robot_level(self) -> Float64:
        """(4, 4) pose on the robot of the level frame of the sensor."""
        from modt.placement import mount_pose

        return mount_pose(self.position_m, (0.0, 0.0, self.roll_pitch_yaw_deg[2]))
