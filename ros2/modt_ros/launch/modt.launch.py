"""Starts modt as a node, and RViz if asked for.

    ros2 launch modt_ros modt.launch.py points:=/ouster/points profile:=os1-64 world_frame_id:=odom rviz:=true

`ros2 launch modt_ros modt.launch.py --show-args` lists the arguments.
"""

from __future__ import annotations

from typing import Any

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, OpaqueFunction
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node
from launch_ros.substitutions import FindPackageShare

ARGUMENTS = {
    "points": ("/points", "topic of the sensor's sensor_msgs/PointCloud2"),
    "source": ("", "another SOURCE of modt run, such as velodyne://, instead of points"),
    "odometry": ("none", "--odometry of modt run: none, or the topic of a nav_msgs/Odometry"),
    "base_to_sensor": ("", "x,y,z,roll,pitch,yaw of the sensor on the robot [m, rad], for odometry"),
    "profile": ("", "--profile of modt run: the sensor (default: what the first sweep shows)"),
    "mode": ("accurate", "--mode of modt run"),
    "core": ("last", "--core of modt run"),
    "out": ("runs/live", "--out of modt run: directory of the records"),
    "prefix": ("modt", "first part of the names of the topics"),
    "frame_id": ("", "frame of the results (default: that of the input)"),
    "world_frame_id": ("", "frame of the poses; publishes /tf from it to frame_id"),
    "tracks": ("objects", "tracks among the detections: objects, or all"),
    "obstacles": ("none", "point clouds of obstacles and ground: none, or all"),
    "rviz": ("false", "start RViz"),
}
"""Default and meaning of each launch argument."""


def command(given: dict[str, str]) -> list[str]:
    """Arguments of modt."""
    words = ["run", given["source"] or f"ros2:///{given['points'].strip('/')}"]
    odometry = given["odometry"]
    if odometry.startswith("/"):
        mount = given["base_to_sensor"]
        odometry = f"ros2:///{odometry.strip('/')}" + (f"?base_to_sensor={mount}" if mount else "")
    names = ("frame_id", "world_frame_id", "tracks", "obstacles")
    options = "&".join(f"{name}={given[name]}" for name in names if given[name])
    words += ["--odometry", odometry, "--sink", f"ros2:///{given['prefix'].strip('/')}?{options}"]
    for name in ("profile", "mode", "core", "out"):
        words += [f"--{name}", given[name]] if given[name] else []
    return words


def nodes(context: Any) -> list[Node]:
    """The nodes of the arguments that were given."""
    given = {name: LaunchConfiguration(name).perform(context) for name in ARGUMENTS}
    made = [Node(package="modt_ros", executable="modt", arguments=command(given), output="screen")]
    if given["rviz"].lower() == "true":
        words = ["-d", f"{FindPackageShare('modt_ros').perform(context)}/config/modt.rviz"]
        fixed = given["world_frame_id"] or given["frame_id"]
        words += ["-f", fixed] if fixed else []
        topics = [(f"/modt/{name}", f"/{given['prefix']}/{name}") for name in ("detections", "markers")]
        topics.append(("/points", given["points"]))
        made.append(Node(package="rviz2", executable="rviz2", arguments=words, remappings=topics))
    return made


def generate_launch_description() -> LaunchDescription:
    """The arguments and the nodes."""
    declared = [
        DeclareLaunchArgument(name, default_value=default, description=meaning)
        for name, (default, meaning) in ARGUMENTS.items()
    ]
    return LaunchDescription([*declared, OpaqueFunction(function=nodes)])
