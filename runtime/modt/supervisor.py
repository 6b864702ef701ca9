"""Notification of a supervisor: systemd by sd_notify(3), without its library, or none."""

from __future__ import annotations

import logging
import socket
from collections.abc import Mapping

from modt.errors import MisuseError

log = logging.getLogger(__name__)

_VARIABLE = "NOTIFY_SOCKET"


class NoSupervisor:
    """No receiver of the state of the loop."""

    def frame_done(self) -> None:
        """No effect."""

    def close(self) -> None:
        """No effect."""


class Systemd:
    """READY=1 with the first frame, WATCHDOG=1 with every frame, STOPPING=1 at the end; sending never blocks.

    The first message that cannot be sent is logged; READY=1 is repeated until it is sent.
    """

    def __init__(self, address: str) -> None:
        self._address, self._ready, self._failed = address, False, False
        self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        self._socket.setblocking(False)

    def frame_done(self) -> None:
        """Report that the service is ready and alive."""
        if self._ready:
            self._send("WATCHDOG=1")
        else:
            self._ready = self._send("READY=1\nWATCHDOG=1")

    def close(self) -> None:
        """Report that the service ends."""
        self._send("STOPPING=1")
        self._socket.close()

    def _send(self, message: str) -> bool:
        try:
            self._socket.sendto(message.encode(), self._address)
        except OSError as error:
            if not self._failed:
                self._failed = True
                cause = error.strerror
                log.warning("%s: systemd cannot be notified (%s); tried again with every frame", _VARIABLE, cause)
            return False
        return True


Supervisor = NoSupervisor | Systemd


def supervisor_of(environment: Mapping[str, str]) -> Supervisor:
    """Systemd where the environment names its socket: /PATH, or @NAME if abstract."""
    name = environment.get(_VARIABLE)
    if not name:
        return NoSupervisor()
    if name[0] not in "/@" or len(name) == 1:
        raise MisuseError(_VARIABLE, f"{name!r} is neither /PATH nor @NAME", "unset it, or let systemd set it")
    return Systemd("\0" + name[1:] if name[0] == "@" else name)
