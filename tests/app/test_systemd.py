"""Notifications to systemd, by real sockets."""

import logging
import os
import socket
from contextlib import contextmanager, suppress

import pytest

from modt.app.systemd import notifier_of
from modt.errors import MisuseError


@contextmanager
def systemd(address):
    """A socket that stands in for systemd's: a function that returns the messages since its last call."""
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as bound:
        bound.bind(str(address))
        bound.setblocking(False)

        def heard():
            messages = []
            with suppress(BlockingIOError):
                while True:
                    messages.append(bound.recv(4096).decode())
            return messages

        yield heard


@pytest.mark.parametrize("place", ["notify", "/", "@", "vsock:2:1234"])
def test_an_invalid_address_is_named(place):
    with pytest.raises(MisuseError, match="NOTIFY_SOCKET"):
        notifier_of({"NOTIFY_SOCKET": place})


@pytest.mark.parametrize("abstract", [False, True])
def test_ready_is_sent_first_and_the_watchdog_served(tmp_path, abstract):
    name = f"@modt-test-{os.getpid()}" if abstract else str(tmp_path / "notify")
    with systemd(name.replace("@", "\0")) as heard:
        notifier = notifier_of({"NOTIFY_SOCKET": name})
        assert heard() == []
        for expected in ("READY=1\nWATCHDOG=1", "WATCHDOG=1"):
            notifier.alive()
            assert heard() == [expected]
        notifier.close()
        assert heard() == ["STOPPING=1"]


def test_unreachable_supervisor_is_logged_once_and_retried(tmp_path, caplog):
    notifier = notifier_of({"NOTIFY_SOCKET": str(tmp_path / "notify")})
    with caplog.at_level(logging.WARNING):
        notifier.alive()
        notifier.alive()
    assert [r.levelname for r in caplog.records] == ["WARNING"]
    with systemd(tmp_path / "notify") as heard:
        notifier.alive()
        assert heard() == ["READY=1\nWATCHDOG=1"]
        notifier.close()


def test_slow_supervisor_does_not_block(tmp_path):
    notifier = notifier_of({"NOTIFY_SOCKET": str(tmp_path / "notify")})
    with systemd(tmp_path / "notify") as heard:
        for _ in range(10_000):  # far more than a socket holds
            notifier.alive()
        assert 1 < len(heard()) < 10_000
        notifier.alive()
        assert heard() == ["WATCHDOG=1"]
        notifier.close()
