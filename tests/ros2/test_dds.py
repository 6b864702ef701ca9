"""Messages over loopback, between two domains of this process."""

from __future__ import annotations

import gc
import os
import time
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest

from modt import host
from modt.errors import ModtError
from modt.ros2 import point_cloud2
from modt.ros2.point_cloud2 import read_cloud, write_cloud
from tests.ros2.network import FAR, NEAR, until

pytest.importorskip("cyclonedds")
from modt.ros2 import dds

pytestmark = pytest.mark.usefixtures("loopback")


def pair(kind, *, reliable=True, depth=5):
    received = dds.Subscription(dds.participant(NEAR), "/topic", kind, depth=depth, reliable=reliable)
    sent = dds.Publication(dds.participant(FAR), "topic", kind)
    until(lambda: sent.receivers and received.senders)
    return received, sent


def test_a_message_arrives_byte_for_byte_with_the_time_of_its_sending():
    received, sent = pair(point_cloud2.TYPE)
    points = np.random.default_rng(0).uniform(0, 1, (5000, 4)).astype(np.float32)
    raw = write_cloud(12.5, "lidar", points)
    assert sent.write(raw)
    (message,) = received.take(60.0)
    assert message.data == raw
    assert message.sent_s == pytest.approx(time.time(), abs=60)
    np.testing.assert_array_equal(read_cloud(message.data).points, points)


def test_bytes_that_are_no_message_of_the_type_are_not_sent():
    _, sent = pair(point_cloud2.TYPE)
    assert not sent.write(b"\0\1\0\0\xff\xff")


def test_the_threads_of_a_domain_run_where_they_are_told():
    allowed = sorted(os.sched_getaffinity(0))
    if len(allowed) < 2:
        pytest.skip("one core")
    gc.collect()
    before = threads()
    with host.threads_on(frozenset(allowed[:1])):
        joined = dds.participant(NEAR - 1)
    begun = threads() - before
    until(lambda: {"recv", "tev"} <= {name for name, _ in alive(begun)})
    assert {cores for _, cores in alive(begun)} == {frozenset(allowed[:1])}
    assert sorted(os.sched_getaffinity(0)) == allowed
    assert dds.participant(NEAR - 1) is joined


def test_a_domain_without_an_interface_is_an_error_with_a_remedy(monkeypatch):
    wrong = (
        '<CycloneDDS><Domain Id="any"><General><Interfaces><NetworkInterface name="none0"/></Interfaces></General>'
    )
    monkeypatch.setenv("CYCLONEDDS_URI", wrong + "</Domain></CycloneDDS>")
    with pytest.raises(ModtError, match="cannot be joined"):
        dds.participant(NEAR - 2)


def test_a_small_socket_buffer_is_warned_of(monkeypatch, tmp_path, caplog):
    (tmp_path / "rmem_max").write_text("212992\n")
    monkeypatch.setattr(dds, "RMEM_MAX", tmp_path / "rmem_max")
    joined = dds.participant(NEAR - 3)
    assert "net.core.rmem_max: 212992 bytes" in caplog.text
    del joined


def threads() -> set[str]:
    return set(os.listdir("/proc/self/task"))


def alive(begun: set[str]) -> list[tuple[str, frozenset[int]]]:
    """Names and cores of the threads that have not ended. The thread that joins a domain ends early."""
    found = []
    for thread in begun:
        with suppress(FileNotFoundError, ProcessLookupError):
            name = (Path("/proc/self/task") / thread / "comm").read_text().strip()
            found.append((name, frozenset(os.sched_getaffinity(int(thread)))))
    return found
