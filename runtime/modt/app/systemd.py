"""Notification of systemd by sd_notify(3), without its library."""

from __future__ import annotations

import logging
import socket
import time
from collections.abc import Callable, Mapping

from modt.errors import MisuseError

log = logging.getLogger(__name__)

_VARIABLE = "NOTIFY_SOCKET"
_WATCHDOG = "WATCHDOG_USEC"


class Notifier:
    """Sends READY=1, WATCHDOG=1 at half its period, STATUS, RELOADING=1 and, at the end, STOPPING=1.

    Sending never blocks. The first message that cannot be sent is logged; READY=1 is repeated until it is sent.

    Args:
        address: address of the socket; None where the process is not a service of systemd.
        watchdog_s: period of the watchdog; None where there is none.
        clock: monotonic [s].
    """

    def __init__(
        self, address: str | None = None, watchdog_s: float | None = None, clock: Callable[[], float] = time.monotonic
    ) -> None:
        self._address = address
        self._clock = clock
        self._interval_s = 0.0 if watchdog_s is None else watchdog_s / 2
        self._ready = False
        self._failed = False
        self._alive_s = float("-inf")
        if address is not None:
            self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
            self._socket.setblocking(False)

    def ready(self) -> None:
        """Report that the service is up."""
        self._ready = self._send("READY=1")

    def alive(self) -> None:
        """Report that the loop is alive, once in half the period of the watchdog."""
        if self._clock() - self._alive_s >= self._interval_s:
            self._alive_s = self._clock()
            self._ready |= self._send("WATCHDOG=1" if self._ready else "READY=1\nWATCHDOG=1")

    def status(self, text: str) -> None:
        """Show a line to the user."""
        self._send(f"STATUS={text}")

    def reloading(self) -> None:
        """Report the begin of a reload, which `ready` ends."""
        self._ready = False
        self._send(f"RELOADING=1\nMONOTONIC_USEC={time.monotonic_ns() // 1000}")

    def close(self) -> None:
        """Report that the service ends."""
        self._send("STOPPING=1")
        if self._address is not None:
            self._socket.close()

    def _send(self, message: str) -> bool:
        """Whether a message was sent, or nobody listens."""
        if self._address is None:
            return True
        try:
            self._socket.sendto(message.encode(), self._address)
        except OSError as error:
            if not self._failed:
                self._failed = True
                log.warning("%s: systemd cannot be notified (%s); tried again", _VARIABLE, error.strerror)
            return False
        return True


def notifier_of(environment: Mapping[str, str]) -> Notifier:
    """Notifier for the socket that the environment names: /PATH, or @NAME if abstract. Without one: no effect.

    Raises:
        MisuseError: the address is neither.
    """
    name = environment.get(_VARIABLE)
    if not name:
        return Notifier()
    if name[0] not in "/@" or len(name) == 1:
        raise MisuseError(_VARIABLE, f"{name!r} is neither /PATH nor @NAME", "unset it, or let systemd set it")
    watchdog = environment.get(_WATCHDOG, "")
    watchdog_s = 1e-6 * int(watchdog) if watchdog.isdecimal() else None
    return Notifier("\0" + name[1:] if name[0] == "@" else name, watchdog_s)
