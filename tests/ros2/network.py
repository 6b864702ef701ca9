"""Two domains of this process that meet over the loopback interface as two processes do."""

import os
import time

import pytest

from modt.errors import ModtError

WORKER = int(os.environ.get("PYTEST_XDIST_WORKER", "gw0").removeprefix("gw"))
NEAR, FAR, WIRE = (201 + 10 * WORKER + k for k in range(3))
"""Two domains that only this process of tests joins, and the one that both are on the wire."""
LOOPBACK = (
    '<CycloneDDS><Domain Id="any"><General><AllowMulticast>false</AllowMulticast>'
    '<Interfaces><NetworkInterface name="lo"/></Interfaces></General>'
    f"<Discovery><ExternalDomainId>{WIRE}</ExternalDomainId><ParticipantIndex>auto</ParticipantIndex>"
    '<Peers><Peer address="127.0.0.1"/></Peers></Discovery></Domain></CycloneDDS>'
)
DEADLINE_S = 60.0


class Scripted:
    """A subscription that hands over batches of messages, one at a time, all sent at 77 s."""

    def __init__(self, *batches):
        self.batches = list(batches)

    def take(self, timeout_s=0.0):
        from modt.ros2.dds import Message

        return [Message(data, 77.0) for data in (self.batches.pop(0) if self.batches else [])]


@pytest.fixture
def loopback(monkeypatch):
    """Join the domains NEAR and FAR, which meet, until the test ends."""
    pytest.importorskip("cyclonedds")
    from modt.ros2.dds import participant

    monkeypatch.setenv("CYCLONEDDS_URI", LOOPBACK)
    monkeypatch.delenv("ROS_DOMAIN_ID", raising=False)
    try:
        joined = [participant(NEAR), participant(FAR)]
    except ModtError as error:
        pytest.skip(f"no loopback interface for DDS here: {error}")
    yield
    del joined


def has_sender(subscription):
    """Whether a sender of its topic is known to a subscription."""
    return bool(subscription._reader.get_matched_publications())


def until(condition):
    """Wait for a condition, at most DEADLINE_S."""
    end_s = time.monotonic() + DEADLINE_S
    while not condition():
        assert time.monotonic() < end_s, "not within the deadline"
        time.sleep(0.01)
