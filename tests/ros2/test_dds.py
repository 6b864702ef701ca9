"""Messages over loopback, between two domains of this process."""

import gc
import os
import time
from contextlib import suppress

import numpy as np
import pytest

from modt import host
from modt.errors import ModtError
from modt.ros2 import point_cloud2
from modt.ros2.point_cloud2 import write_cloud
from tests.ros2.network import FAR, LOOPBACK, NEAR, has_sender, until

pytest.importorskip("cyclonedds")
from modt.ros2 import dds

pytestmark = pytest.mark.usefixtures("loopback")


def test_a_message_arrives_byte_for_byte_with_the_time_of_its_sending_and_other_bytes_are_not_sent():
    received = dds.Subscription(dds.participant(NEAR), "/topic", point_cloud2.TYPE, depth=5, reliable=True)
    sent = dds.Publication(dds.participant(FAR), "topic", point_cloud2.TYPE)
    until(lambda: sent.receivers and has_sender(received))
    raw = write_cloud(12.5, "lidar", np.ones((5000, 4), np.float32))
    assert not sent.write(b"\0\1\0\0\xff\xff")
    assert sent.write(raw)
    (message,) = received.take(60.0)
    assert message.data == raw
    assert message.sent_s == pytest.approx(time.time(), abs=60)


def test_the_threads_of_a_domain_run_where_they_are_told():
    allowed = sorted(os.sched_getaffinity(0))
    if len(allowed) < 2:
        pytest.skip("one core")
    gc.collect()
    before = {*os.listdir("/proc/self/task")}
    cores = []
    with host.threads_on(frozenset(allowed[:1])):
        joined = dds.participant(NEAR - 1)
    for thread in {*os.listdir("/proc/self/task")} - before:
        with suppress(ProcessLookupError):  # the thread that joins a domain ends early
            cores.append(os.sched_getaffinity(int(thread)))
    assert len(cores) > 1
    assert all(each == {allowed[0]} for each in cores)
    assert sorted(os.sched_getaffinity(0)) == allowed
    assert dds.participant(NEAR - 1) is joined


def test_a_domain_without_an_interface_is_an_error_with_a_remedy(monkeypatch):
    monkeypatch.setenv("CYCLONEDDS_URI", LOOPBACK.replace('"lo"', '"none0"'))
    with pytest.raises(ModtError, match="cannot be joined"):
        dds.participant(NEAR - 2)


def test_a_small_socket_buffer_is_warned_of(monkeypatch, tmp_path, caplog):
    (tmp_path / "rmem_max").write_text("212992\n")
    monkeypatch.setattr(dds, "RMEM_MAX", tmp_path / "rmem_max")
    joined = dds.participant(NEAR - 3)
    assert "net.core.rmem_max: 212992 bytes" in caplog.text
    del joined
