"""Fake of the parts of rclpy and of the message packages that the node uses. Topics lead back to this process."""

import sys
import threading
from collections import defaultdict
from types import ModuleType, SimpleNamespace

PACKAGES = ("sensor_msgs", "nav_msgs", "vision_msgs", "visualization_msgs", "tf2_msgs", "diagnostic_msgs")


class Types(ModuleType):
    """A module that has a class of any name."""

    def __getattr__(self, name):
        if name.startswith("__"):
            raise AttributeError(name)
        return type(name, (), {"__module__": self.__name__})


class Node:
    """A node whose topics hand bytes from publishers to subscriptions."""

    def __init__(self):
        self.subscribed = defaultdict(list)
        self.types = {}

    def create_subscription(self, kind, topic, callback, qos, *, raw):
        assert raw
        self.subscribed[topic].append(callback)
        self.types[topic] = f"{kind.__module__}.{kind.__name__}"

    def create_publisher(self, kind, topic, qos):
        self.types[topic] = f"{kind.__module__}.{kind.__name__}"
        return SimpleNamespace(
            publish=lambda data: [receive(data) for receive in self.subscribed[topic]],
            get_subscription_count=lambda: len(self.subscribed[topic]),
        )


def put(monkeypatch, modules):
    """Put modules of these contents in the place of those of their names."""
    for name, content in modules.items():
        module = ModuleType(name)
        vars(module).update(content)
        monkeypatch.setitem(sys.modules, name, module)


def install(monkeypatch):
    """Put the fake in the place of rclpy, and return its one node."""
    node = Node()
    spinning = threading.Event()
    executor = SimpleNamespace(add_node=lambda node: None, spin=spinning.set)
    modules = {
        "rclpy": {"create_node": lambda name: node, "init": lambda **_: None},
        "rclpy.executors": {"SingleThreadedExecutor": lambda: executor},
        "rclpy.qos": {"QoSProfile": SimpleNamespace, "ReliabilityPolicy": SimpleNamespace(RELIABLE=1, BEST_EFFORT=2)},
        "rclpy.signals": {"SignalHandlerOptions": SimpleNamespace(NO=0)},
        "rclpy.utilities": {"remove_ros_args": lambda words: words[: words.index("--ros-args")]},
    }
    put(monkeypatch, modules)
    for package in PACKAGES:
        monkeypatch.setitem(sys.modules, package, ModuleType(package))
        monkeypatch.setitem(sys.modules, f"{package}.msg", Types(f"{package}.msg"))
    return node
