"""Notifications to systemd, by real sockets."""

import logging
import os
import socket

import pytest

from modt.app.supervisor import supervisor_of
from modt.errors import MisuseError


class Listener:
    """Stands in for systemd."""

    def __init__(self, address):
        self.socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        self.socket.bind(address)
        self.socket.setblocking(False)

    def heard(self):
        """Messages so far."""
        messages = []
        while True:
            try:
                messages.append(self.socket.recv(4096).decode())
            except BlockingIOError:
                return messages


@pytest.fixture(name="listen")
def listeners():
    made = []

    def listen(address):
        made.append(Listener(address))
        return made[-1]

    yield listen
    for listener in made:
        listener.socket.close()


@pytest.mark.parametrize("abstract", [False, True])
def test_ready_is_said_first_and_the_watchdog_served(tmp_path, listen, abstract):
    name = f"modt-test-{os.getpid()}"
    systemd = listen(f"\0{name}" if abstract else str(tmp_path / "notify"))
    supervisor = supervisor_of({"NOTIFY_SOCKET": f"@{name}" if abstract else str(tmp_path / "notify")})
    assert systemd.heard() == []
    supervisor.alive()
    assert systemd.heard() == ["READY=1\nWATCHDOG=1"]
    supervisor.alive()
    supervisor.alive()
    assert systemd.heard() == ["WATCHDOG=1"] * 2
    supervisor.close()
    assert systemd.heard() == ["STOPPING=1"]


@pytest.mark.parametrize("environment", [{}, {"NOTIFY_SOCKET": ""}])
def test_without_a_socket_there_is_no_supervisor(environment):
    opened = os.listdir("/proc/self/fd")
    supervisor = supervisor_of(environment)
    supervisor.alive()
    assert os.listdir("/proc/self/fd") == opened
    supervisor.close()


@pytest.mark.parametrize("place", ["notify", "/", "@", "vsock:2:1234"])
def test_invalid_address_is_named(place):
    with pytest.raises(MisuseError, match="NOTIFY_SOCKET"):
        supervisor_of({"NOTIFY_SOCKET": place})


def test_unreachable_supervisor_is_logged_once_and_retried(tmp_path, listen, caplog):
    supervisor = supervisor_of({"NOTIFY_SOCKET": str(tmp_path / "notify")})
    with caplog.at_level(logging.WARNING):
        supervisor.alive()
        supervisor.alive()
    assert [r.levelname for r in caplog.records] == ["WARNING"]
    systemd = listen(str(tmp_path / "notify"))
    supervisor.alive()
    assert systemd.heard() == ["READY=1\nWATCHDOG=1"]
    supervisor.close()


def test_slow_supervisor_does_not_block(tmp_path, listen):
    systemd = listen(str(tmp_path / "notify"))
    supervisor = supervisor_of({"NOTIFY_SOCKET": str(tmp_path / "notify")})
    for _ in range(10_000):  # far more than a socket holds
        supervisor.alive()
    heard = systemd.heard()
    assert heard[0] == "READY=1\nWATCHDOG=1"
    assert 1 < len(heard) < 10_000
    supervisor.alive()
    assert systemd.heard() == ["WATCHDOG=1"]
    supervisor.close()
