"""Packets of a live sensor, received from a UDP socket."""

from __future__ import annotations

import logging
import socket
import struct
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import replace

from modt.errors import MisuseError
from modt.sources.live.live_stream import LATE_S
from modt.sources.packets.packet_decoder import PacketDecoder
from modt.sources.stream import Sweep

log = logging.getLogger(__name__)

MAX_BYTES = 65_535
BUFFER_BYTES = 4 * 2**20
"""Requested receive buffer, which holds a second of the fastest sensor."""
TIMESTAMP = 35
"""SO_TIMESTAMPNS, which Python does not name: Linux reports the time of reception with each packet."""
TIMESPEC = struct.Struct("@ll")
"""Time of reception [s, ns]."""
PAUSE_S = 0.01
"""Time without a packet after which a sensor with a blind sector may have ended its sweep [s]."""

MAX_DESCRIPTIONS = 10
"""Greatest number of packets in which a sensor tells of itself that one read takes."""


class PacketReader:
    """Receives and decodes the packets of one sensor.

    Attributes:
        reception: counts of packets, which are those of the decoder.
        decoder: decoder of the packets.
        descriptions: bound socket of the packets in which the sensor tells of itself, which the reader closes; None
            for a sensor without such packets.
    """

    descriptions: socket.socket | None = None

    def __init__(
        self,
        bound: socket.socket,
        decoder: PacketDecoder,
        source: str | None = None,
        clock: Callable[[], float] = time.time,
    ) -> None:
        """Read from a bound socket.

        Args:
            bound: socket, which the reader closes.
            decoder: decoder of the packets.
            source: address of the sensor, whose packets alone are used; None for any.
            clock: clock of the reception [s since 1970], of which a packet that waited is late. The timeout of `read`
                runs on the monotonic clock.
        """
        self.reception = decoder.reception
        self.decoder = decoder
        self._socket = bound
        self._source = source
        self._clock = clock

    @property
    def profile(self) -> str | None:
        """Shipped profile of the sensor; None where there is none, or before its packets have identified it."""
        return self.decoder.profile

    def read(self, timeout_s: float) -> Sequence[Sweep]:
        """Receive until the timeout or the first finished sweep."""
        until_s = time.monotonic() + timeout_s
        self._socket.settimeout(min(timeout_s, PAUSE_S))
        self._describe()
        while True:
            try:
                payload, ancillary, _, address = self._socket.recvmsg(MAX_BYTES, socket.CMSG_SPACE(TIMESPEC.size))
            except (TimeoutError, BlockingIOError):
                sweeps = self.decoder.pause()
                if sweeps or time.monotonic() >= until_s:
                    return sweeps
                continue
            sweeps = self._decoded(payload, ancillary, address[0])
            if sweeps or time.monotonic() >= until_s:
                return sweeps

    def _describe(self) -> None:
        """Hand over the waiting packets in which the sensor tells of itself, at most MAX_DESCRIPTIONS of them."""
        if self.descriptions is None:
            return
        for _ in range(MAX_DESCRIPTIONS):
            try:
                payload, (sender, _) = self.descriptions.recvfrom(MAX_BYTES, socket.MSG_DONTWAIT)
            except BlockingIOError:
                return
            if self._source in (None, sender):
                self.decoder.describe(payload)

    def _decoded(self, payload: bytes, ancillary: Sequence[tuple[int, int, bytes]], sender: str) -> Sequence[Sweep]:
        """Sweeps completed by a packet, with the time of its reception, if the kernel tells it."""
        self.reception.messages += 1
        now_s = self._clock()
        received_s = now_s
        for _, _, raw in ancillary[:1]:
            seconds, nanoseconds = TIMESPEC.unpack(raw)
            received_s = seconds + 1e-9 * nanoseconds
        if self._source not in (None, sender):
            reason = "from another address than the sensor's"
        elif now_s - received_s > LATE_S:
            reason = "late: this process was stopped, or has too little CPU time, or the clock was set"
        else:
            waited_s = max(now_s - received_s, 0.0)
            return [replace(sweep, waited_s=waited_s) for sweep in self.decoder.decode(received_s, payload)]
        self.decoder.refuse(reason)
        return []

    def close(self) -> None:
        """Release the socket; a thread that waits in `read` notices it within PAUSE_S."""
        self._socket.close()
        if self.descriptions is not None:
            self.descriptions.close()


def bound_socket(name: str, port: int, group: str = "") -> socket.socket:
    """Bind a socket to a UDP port of this machine, for broadcasts and a multicast group too.

    Raises:
        MisuseError: the port is taken or not allowed, or the group cannot be joined.
    """
    made = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    with suppress(OSError):  # without it, packets have the time at which they are read
        made.setsockopt(socket.SOL_SOCKET, TIMESTAMP, 1)
    cause = f"port {port} cannot be bound"
    remedy = "end what else reads this sensor, or give the port that it sends to"
    try:
        made.bind(("", port))
        if group:
            cause = f"group {group} cannot be joined"
            remedy = "give an address from 224.0.0.0 on, and a route to it (ip route add 224.0.0.0/4 dev INTERFACE)"
            made.setsockopt(socket.IPPROTO_IP, socket.IP_ADD_MEMBERSHIP, socket.inet_aton(group) + bytes(4))
    except OSError as error:
        made.close()
        raise MisuseError(name, f"{cause} ({error.strerror or error})", remedy) from None
    made.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, BUFFER_BYTES)
    granted = made.getsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF) // 2  # Linux reports twice the size
    if granted < BUFFER_BYTES:
        remedy = f"sysctl -w net.core.rmem_max={BUFFER_BYTES}"
        log.warning("%s: receive buffer of %d bytes granted, %d asked; %s", name, granted, BUFFER_BYTES, remedy)
    return made


def port_of(name: str, text: str) -> int:
    """UDP port that an option names.

    Raises:
        MisuseError: it is none.
    """
    if not (text.isdecimal() and 0 < int(text) < 65_536):
        raise MisuseError(name, f"{text!r} is no port", "write a number from 1 to 65535")
    return int(text)


def address_of(name: str, host: str) -> str | None:
    """IPv4 address of a host, None for an empty name.

    Raises:
        MisuseError: the host is unknown.
    """
    try:
        return socket.gethostbyname(host) if host else None
    except OSError as error:
        raise MisuseError(name, f"host {host} is unknown ({error.strerror})", "give the sensor's address") from None
