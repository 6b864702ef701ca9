"""One of several sensors of a robot, with its profile."""

from __future__ import annotations

from dataclasses import dataclass, fields

from modt.config.mounted_sensor import MountedSensor
from modt.config.profile import ProfileConfig


@dataclass(frozen=True, kw_only=True)
class ReadSensor(MountedSensor):
    """One of several sensors of a robot, with its profile as it was read together with that of the robot."""

    read: ProfileConfig

    @classmethod
    def of(cls, mounted: MountedSensor, read: ProfileConfig) -> ReadSensor:
        """A mounted sensor with its profile."""
        return cls(**{f.name: getattr(mounted, f.name) for f in fields(mounted)}, read=read)
