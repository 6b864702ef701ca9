"""The command `modt` as a node: its topics go through the middleware that ROS 2 is set up with.

    ros2 run modt_ros modt run ros2:///points --sink ros2:///modt

Every command of modt works this way, without Cyclone DDS for Python.
"""

from __future__ import annotations

import sys

from modt_ros import middleware


def main() -> None:
    """Run a command of modt. Arguments after --ros-args belong to the node."""
    import rclpy
    from rclpy.signals import SignalHandlerOptions
    from rclpy.utilities import remove_ros_args

    rclpy.init(args=sys.argv, signal_handler_options=SignalHandlerOptions.NO)  # modt handles them itself
    sys.argv = remove_ros_args(sys.argv)
    sys.modules["modt.ros2.dds"] = middleware  # in place of Cyclone DDS
    from modt.cli.main import main as modt

    raise SystemExit(modt(sys.argv[1:]))
