"""Robots with several sensors, for tests."""

from dataclasses import replace

from modt.config import MountedSensor
from modt.profile import load

PROFILE = "vlp-16"


def mounted(name, x, y, yaw_deg, source="", z=0.6):
    """A sensor on a robot [m, deg]."""
    return MountedSensor(
        name=name, profile=PROFILE, source=source, position_m=(x, y, z), roll_pitch_yaw_deg=(0.0, 0.0, yaw_deg)
    )


FRONT = mounted("front", 0.5, 0.35, 45.0, "velodyne://:2368")
REAR = mounted("rear", -0.5, -0.35, -135.0, "velodyne://:2369")
CORNERS = (FRONT, REAR)


def robot(*sensors):
    """The profile of a robot with these sensors."""
    return replace(load(PROFILE), sensors=sensors)
