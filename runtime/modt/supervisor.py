"""Whoever started this process and watches over it: systemd by sd_notify(3), without its library, or nobody."""

from __future__ import annotations

import logging
import socket
from collections.abc import Mapping
from typing import Protocol

from modt.errors import MisuseError

log = logging.getLogger(__name__)

VARIABLE = "NOTIFY_SOCKET"


class Supervisor(Protocol):
    """Is told how the loop is doing."""

    def frame_done(self) -> None:
        """One more frame has been worked off and written."""
        ...

    def close(self) -> None:
        """The loop has ended."""
        ...


class NoSupervisor:
    """Nobody listens."""

    def frame_done(self) -> None:
        """Nothing."""

    def close(self) -> None:
        """Nothing."""


class Systemd:
    """READY=1 with the first frame, WATCHDOG=1 with every frame, STOPPING=1 at the end; never waited for.

    What cannot be sent is logged once and left, for the watchdog hears of the next frame; READY=1 is tried again.

    Args:
        address: of the datagram socket that it listens at.
    """

    def __init__(self, address: str) -> None:
        self._address, self._ready, self._unheard = address, False, False
        self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        self._socket.setblocking(False)

    def frame_done(self) -> None:
        """The service is up, and alive."""
        if self._ready:
            self._say("WATCHDOG=1")
        else:
            self._ready = self._say("READY=1\nWATCHDOG=1")

    def close(self) -> None:
        """The service is about to end."""
        self._say("STOPPING=1")
        self._socket.close()

    def _say(self, message: str) -> bool:
        try:
            self._socket.sendto(message.encode(), self._address)
        except OSError as error:
            if not self._unheard:
                self._unheard = True
                log.warning("%s: systemd is not told (%s); tried again with every frame", VARIABLE, error.strerror)
            return False
        return True


def supervisor_of(environment: Mapping[str, str]) -> Supervisor:
    """Systemd where the environment names its socket: /PATH, or @NAME of an abstract one.

    Raises:
        MisuseError: it names something else.
    """
    place = environment.get(VARIABLE)
    if not place:
        return NoSupervisor()
    if place[0] not in "/@" or len(place) == 1:
        raise MisuseError(VARIABLE, f"{place!r} is neither /PATH nor @NAME", "unset it, or let systemd set it")
    return Systemd("\0" + place[1:] if place[0] == "@" else place)
