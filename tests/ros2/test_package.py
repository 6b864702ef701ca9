"""The files of the package modt_ros agree with modt, and its node exchanges messages by a fake rclpy."""

import argparse
import json
import re
import runpy
import sys
import threading
import xml.etree.ElementTree as ET
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import yaml

import modt
from modt.address import parse_address
from modt.cli import run
from modt.config import OdometryConfig
from modt.errors import MisuseError
from modt.ros2.odometry import write_odometry
from modt.ros2.point_cloud2 import write_cloud
from modt.schemes import POSES, SENSORS, SINKS, open_poses, open_sensor, open_sink
from modt.sinks.foxglove_sinks import FIGURES
from modt.sinks.topics import PREFIX, TopicOptions, topics
from tests.results import CAR, result
from tests.ros2 import fake_rclpy

ROOT = Path(__file__).resolve().parents[2]
PACKAGE = ROOT / "ros2" / "modt_ros"
FRAME = result(3, [5, 4], {0: 1, 1: 12}, {1: CAR})
PUBLISHED = {topic.name: topic.type for topic in topics(TopicOptions(world_frame_id="world", points=True))}


def test_the_manifest_has_the_version_of_modt_and_the_setup_holds_every_file():
    manifest = ET.parse(PACKAGE / "package.xml").getroot()
    assert manifest.findtext("version") == modt.__version__
    assert manifest.findtext("export/build_type") == "ament_python"
    depends = {element.text for element in manifest.iter("exec_depend")}
    assert {kind.partition("/")[0] for kind in PUBLISHED.values()} <= depends
    setup = (PACKAGE / "setup.py").read_text()
    assert f'version="{modt.__version__}"' in setup
    files = [path for folder in ("launch", "config") for path in (PACKAGE / folder).iterdir() if path.is_file()]
    assert [path for path in files if f'"{path.relative_to(PACKAGE)}"' not in setup] == []


def test_rviz_shows_topics_of_modt_with_their_types():
    config = yaml.safe_load((PACKAGE / "config" / "modt.rviz").read_text())["Visualization Manager"]
    shown = {d["Topic"]["Value"]: d["Class"].rpartition("/")[2] for d in config["Displays"] if "Topic" in d}
    assert shown.pop("/points") == "PointCloud2"
    assert shown == {topic: PUBLISHED[topic].rpartition("/")[2] for topic in ("/modt/markers", "/modt/detections")}


def test_the_layout_of_foxglove_shows_topics_of_modt():
    text = (PACKAGE / "config" / "foxglove.json").read_text()
    panels = set(re.findall(r'"(?:first|second)": "([^"]+)"', text))
    assert panels == json.loads(text)["configById"].keys()
    named = set(re.findall(rf"/{PREFIX}/\w+(?:/\w+)?", text))
    assert named <= PUBLISHED.keys() | {f"/{PREFIX}/{name}" for name in FIGURES}  # of energy and CPU time
    assert {"/modt/markers", "/modt/points", "/modt/detections"} <= named


@pytest.fixture(name="launched")
def launch_file(monkeypatch):
    """The launch file, and a function from arguments to the nodes that it starts."""
    made = SimpleNamespace
    stubs = {
        "launch": {"LaunchDescription": list},
        "launch.actions": {
            "DeclareLaunchArgument": lambda name, **more: made(name=name, **more),
            "OpaqueFunction": lambda function: made(function=function),
        },
        "launch.substitutions": {"LaunchConfiguration": lambda name: made(perform=lambda given: given[name])},
        "launch_ros": {},
        "launch_ros.actions": {"Node": made},
        "launch_ros.substitutions": {"FindPackageShare": lambda name: made(perform=lambda _: f"/share/{name}")},
    }
    fake_rclpy.put(monkeypatch, stubs)
    *declared, nodes = runpy.run_path(str(PACKAGE / "launch" / "modt.launch.py"))["generate_launch_description"]()
    defaults = {argument.name: argument.default_value for argument in declared}
    return lambda **given: nodes.function(defaults | given)


@pytest.mark.parametrize(
    "given",
    [
        {},
        {"points": "/os/points", "odometry": "/odom", "base_to_sensor": "0.1,0,0.5,0,0,0"},
        {"source": "velodyne://", "profile": "vlp-16", "mode": "efficient", "core": "none", "out": "/tmp/x"},
        {"prefix": "robot", "frame_id": "velodyne", "world_frame_id": "odom", "tracks": "all", "obstacles": "all"},
    ],
)
def test_launch_arguments_become_options_of_modt_run(launched, given):
    (node,) = launched(**given)
    assert (node.package, node.executable) == ("modt_ros", "modt")
    parser = argparse.ArgumentParser()
    run.add_parser(parser.add_subparsers())
    options = parser.parse_args(node.arguments)
    source = parse_address(options.source, SENSORS)
    assert source.text == given.get("source", f"ros2:///{given.get('points', '/points')[1:]}")
    (sink,) = options.sink
    wanted = {k: given[k] for k in ("frame_id", "world_frame_id", "tracks", "obstacles") if k in given}
    address = parse_address(sink, SINKS)
    assert address.path == f"/{given.get('prefix', 'modt')}"
    assert dict(address.options) == {"tracks": "objects", "obstacles": "none", **wanted}
    if "odometry" in given:
        assert parse_address(options.odometry, POSES).option("base_to_sensor") == given["base_to_sensor"]
    else:
        assert options.odometry == "none"
    assert options.mode == given.get("mode", "accurate")
    assert options.profile == ([given["profile"]] if "profile" in given else [])


def test_rviz_is_started_on_request_with_the_topics_of_the_run(launched):
    _, rviz = launched(rviz="true", points="/os/points", prefix="robot", world_frame_id="odom")
    assert rviz.arguments == ["-d", "/share/modt_ros/config/modt.rviz", "-f", "odom"]
    assert dict(rviz.remappings) == {
        "/points": "/os/points",
        "/modt/markers": "/robot/markers",
        "/modt/detections": "/robot/detections",
    }


@pytest.fixture(name="node")
def node_of_ros_2(monkeypatch):
    """The node in place of Cyclone DDS."""
    monkeypatch.syspath_prepend(str(PACKAGE))
    monkeypatch.delenv("ROS_DOMAIN_ID", raising=False)
    node = fake_rclpy.install(monkeypatch)
    from modt_ros import middleware

    middleware._node.cache_clear()
    users = ("modt.sources.live.ros2", "modt.poses.pose_topic", "modt.sinks.ros2")
    for name in users:
        monkeypatch.delitem(sys.modules, name, raising=False)
    monkeypatch.setitem(sys.modules, "modt.ros2.dds", middleware)
    yield node
    for name in users:
        sys.modules.pop(name, None)


def test_clouds_and_poses_of_the_node_reach_modt_and_its_results_the_node(node):
    points = np.random.default_rng(0).uniform(1, 9, (500, 4)).astype(np.float32)
    source = open_sensor("ros2:///points")
    source.start()
    for receive in node.subscribed["/points"]:
        receive(write_cloud(12.5, "velodyne", points))
    frame = source.take(60.0).frame
    source.close()
    np.testing.assert_array_equal(frame.points[:, :3], points[:, :3])
    assert frame.frame_id == "velodyne"
    poses = open_poses("ros2:///odom", OdometryConfig())
    node.subscribed["/odom"][0](write_odometry(1.0, "odom", "base_link", np.eye(4)))
    assert [poses._read(message)[0] for message in poses._take()] == [1.0]
    received = []
    written = threading.Event()
    node.subscribed["/modt/markers"].append(lambda data: (received.append(data), written.set()))
    sink = open_sink("ros2:///modt")
    sink.write(FRAME)
    assert written.wait(60.0)
    sink.close()
    (markers,) = (topic for topic in topics() if topic.name == "/modt/markers")
    assert received == [markers.encode(FRAME)]
    assert node.types["/points"] == "sensor_msgs.msg.PointCloud2"
    assert node.types["/modt/detections"] == "vision_msgs.msg.Detection3DArray"


def test_a_domain_besides_that_of_the_node_is_refused(node):
    with pytest.raises(MisuseError, match="ROS_DOMAIN_ID"):
        open_sensor("ros2:///points?domain=3")


def test_the_command_runs_without_the_arguments_of_the_node(node, monkeypatch, capsys):
    from modt_ros.node import main

    monkeypatch.setattr(sys, "argv", ["modt", "--version", "--ros-args", "-r", "__node:=modt"])
    with pytest.raises(SystemExit) as ended:
        main()
    assert ended.value.code in (None, 0)
    assert modt.__version__ in capsys.readouterr().out
