"""Topics by rclpy, with the interface of `modt.ros2.dds`. Messages pass as bytes, so none is decoded twice."""

from __future__ import annotations

import os
import threading
import time
from collections import deque
from dataclasses import dataclass
from functools import cache
from importlib import import_module
from typing import Any

from modt.errors import MisuseError


@dataclass(frozen=True)
class Message:
    """A message as received, and when it arrived [s]."""

    data: bytes
    sent_s: float


class Participant:
    """The node, and a thread that takes what arrives."""

    def __init__(self, cores: frozenset[int] | None) -> None:
        import rclpy
        from rclpy.executors import SingleThreadedExecutor

        self.node = rclpy.create_node("modt")
        self._executor = SingleThreadedExecutor()
        self._executor.add_node(self.node)
        threading.Thread(target=self._spin, args=(cores,), name="rclpy", daemon=True).start()

    def _spin(self, cores: frozenset[int] | None) -> None:
        if cores:
            os.sched_setaffinity(0, cores)
        self._executor.spin()


@cache
def _node(cores: frozenset[int] | None) -> Participant:
    return Participant(cores)


def participant(domain_id: int, cores: frozenset[int] | None = None) -> Participant:
    """The node. Its domain is the one of ROS_DOMAIN_ID, as for every node.

    Raises:
        MisuseError: another domain is asked for.
    """
    if domain_id != int(os.environ.get("ROS_DOMAIN_ID") or 0):
        raise MisuseError(f"domain {domain_id}", "a node is in one domain", "set ROS_DOMAIN_ID, without domain=")
    return _node(None) if _node.cache_info().currsize else _node(cores)


class Subscription:
    """The messages of a topic, the last `depth` of them; read by one thread."""

    mismatch = ""  # rclpy logs a quality of service that does not fit

    def __init__(self, joined: Participant, name: str, kind: str, *, depth: int, reliable: bool = False) -> None:
        self._messages: deque[Message] = deque(maxlen=depth)
        self._arrival = threading.Condition()
        joined.node.create_subscription(_type(kind), _absolute(name), self._receive, _qos(depth, reliable), raw=True)

    def take(self, timeout_s: float = 0.0) -> list[Message]:
        """The messages that have arrived, oldest first, waited for at most `timeout_s`."""
        with self._arrival:
            self._arrival.wait_for(lambda: self._messages, timeout_s)
            taken = list(self._messages)
            self._messages.clear()
        return taken

    def _receive(self, data: bytes) -> None:
        with self._arrival:
            self._messages.append(Message(data, time.time()))
            self._arrival.notify()


class Publication:
    """Sends to a topic."""

    def __init__(self, joined: Participant, name: str, kind: str, *, depth: int = 5) -> None:
        self._publisher = joined.node.create_publisher(_type(kind), _absolute(name), _qos(depth, reliable=True))

    def write(self, message: bytes) -> bool:
        """Send a message."""
        self._publisher.publish(message)
        return True

    @property
    def receivers(self) -> int:
        """Subscribers of the topic."""
        return int(self._publisher.get_subscription_count())


def _absolute(name: str) -> str:
    return "/" + name.strip("/")


def _type(kind: str) -> Any:
    package, _, name = kind.partition("/")
    return getattr(import_module(f"{package}.msg"), name)


def _qos(depth: int, reliable: bool) -> Any:
    from rclpy.qos import QoSProfile, ReliabilityPolicy

    policy = ReliabilityPolicy.RELIABLE if reliable else ReliabilityPolicy.BEST_EFFORT
    return QoSProfile(depth=depth, reliability=policy)
