"""Fixtures that every test may use."""

from __future__ import annotations

import os
import socket
from contextlib import ExitStack
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, settings

from tests.ros2.network import loopback  # noqa: F401
from tests.viewer.chromium import chromium  # noqa: F401

settings.register_profile("modt", deadline=None, suppress_health_check=[HealthCheck.too_slow], derandomize=True)
settings.load_profile("modt")


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Run what is installed first: it takes longest, and no process shall wait for it at the end."""
    items.sort(key=lambda item: item.get_closest_marker("install") is None)


@pytest.fixture(scope="session")
def kitti_root() -> Path:
    """Real data in KITTI's layout."""
    root = os.environ.get("KITTI_ROOT")
    if not root:
        pytest.skip("KITTI_ROOT is not set: no real data here")
    return Path(root)


@pytest.fixture
def rng() -> np.random.Generator:
    """Random numbers, the same in each test."""
    return np.random.default_rng(0)


@pytest.fixture
def ports() -> list[int]:
    """Two ports for datagrams that are free."""
    with ExitStack() as probes:
        bound = [probes.enter_context(socket.socket(socket.AF_INET, socket.SOCK_DGRAM)) for _ in range(2)]
        for probe in bound:
            probe.bind(("", 0))
        return [int(probe.getsockname()[1]) for probe in bound]


@pytest.fixture
def port(ports: list[int]) -> int:
    """Port for datagrams that is free."""
    return ports[0]


@pytest.fixture(scope="session")
def drive_0005(kitti_root: Path) -> Path:
    """A whole raw drive."""
    return kitti_root / "raw" / "2011_09_26" / "2011_09_26_drive_0005_sync"
