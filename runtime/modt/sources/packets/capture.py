"""PCAP files as streams, and the UDP datagrams in them.

Files of either byte order with stamps in µs or ns are read; IPv4 and IPv6 over Ethernet, Linux cooked or raw IP.
"""

from __future__ import annotations

import socket
import struct
from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from itertools import islice
from pathlib import Path
from typing import BinaryIO

from modt.errors import MisuseError
from modt.sources.packets import hesai, livox, velodyne
from modt.sources.packets.packet_decoder import PacketDecoder, decoder_for
from modt.sources.stamp_check import StampCheck
from modt.sources.stream import Faults, Reception, StreamInfo, Sweep
from modt.types import Frame, Self

MAX_PENDING = 64
"""Greatest number of incomplete packets; beyond it the oldest one is dropped."""
MORE, OFFSET = 0x2000, 0x1FFF
MAX_PACKET_BYTES = 65_535
IPV6_BYTES, FRAGMENT = 40, 44
EXTENSIONS = (0, 43, FRAGMENT, 60)
"""Extension headers of IPv6: hop by hop, routing, fragment, destination."""


Packet = tuple[str, int, bytes]
"""Source, protocol and payload of a whole IP packet."""


class Fragments:
    """Joins the fragments of IP packets, with bounded memory."""

    def __init__(self) -> None:
        self._pending: dict[bytes, dict[int, tuple[bytes, bool]]] = {}

    def whole(self, raw: bytes) -> Packet | None:
        """Packet that these bytes complete; None while a part is missing, or if they are no IP packet."""
        version = raw[0] >> 4 if raw else 0
        if version == 6 and len(raw) >= IPV6_BYTES:
            return self._whole_of_ipv6(raw)
        if version != 4 or len(raw) < 20:
            return None
        start, length = 4 * (raw[0] & 15), int.from_bytes(raw[2:4], "big")
        flags = struct.unpack_from(">H", raw, 6)[0]
        key = raw[12:20] + raw[4:6] + raw[9:10]
        payload = self._joined(key, 8 * (flags & OFFSET), raw[start : length or None], bool(flags & MORE))
        return None if payload is None else (".".join(map(str, raw[12:16])), raw[9], payload)

    def _whole_of_ipv6(self, raw: bytes) -> Packet | None:
        length, kind, payload = int.from_bytes(raw[4:6], "big"), raw[6], raw[IPV6_BYTES:]
        whole: bytes | None = payload[: length or None]
        while whole and kind in EXTENSIONS and len(whole) >= 8:
            kind, extension, size = whole[0], kind, 8 if kind == FRAGMENT else 8 * (whole[1] + 1)
            where, key, whole = int.from_bytes(whole[2:4], "big"), raw[8:IPV6_BYTES] + whole[4:8], whole[size:]
            if extension == FRAGMENT:
                whole = self._joined(key, where & ~7, whole, bool(where & 1))
        return None if whole is None else (socket.inet_ntop(socket.AF_INET6, raw[8:24]), kind, whole)

    def _joined(self, key: bytes, offset: int, payload: bytes, more: bool) -> bytes | None:
        """Payload that a fragment completes, None while a part is missing."""
        if not offset and not more:
            return payload
        parts = self._pending.setdefault(key, {})
        parts[offset] = (payload, more)
        out, at = b"", 0
        while at in parts and len(out) <= MAX_PACKET_BYTES:
            part, more = parts[at]
            out, at = out + part, at + len(part)
            if not more:
                del self._pending[key]
                return out
            if not part:
                break
        if len(self._pending) > MAX_PENDING:
            del self._pending[next(iter(self._pending))]
        return None


MAGICS = {
    b"\xd4\xc3\xb2\xa1": ("<", 1e-6),
    b"\xa1\xb2\xc3\xd4": (">", 1e-6),
    b"\x4d\x3c\xb2\xa1": ("<", 1e-9),
    b"\xa1\xb2\x3c\x4d": (">", 1e-9),
}
"""Byte order and unit of the stamps [s]."""
PCAPNG = b"\x0a\x0d\x0d\x0a"
ETHERNET, RAW_IP, COOKED, COOKED_2 = 1, 101, 113, 276
LINK_HEADERS = {ETHERNET: (12, 14), COOKED: (14, 16), COOKED_2: (0, 20)}
"""Offsets of the protocol and of the payload by link type."""
IPS, VLAN_TAGS, UDP = (0x0800, 0x86DD), (0x8100, 0x88A8, 0x9100), 17
MAX_RECORD_BYTES = 262_144
"""Greatest snapshot length of tcpdump; a record that promises more is broken."""


@dataclass(frozen=True, slots=True)
class Datagram:
    """A UDP datagram.

    Attributes:
        stamp_s: time of its capture [s since 1970].
        source: IP address of the sender.
        port: port of the receiver.
        payload: its bytes, fewer than were sent where the capture was cut short.
    """

    stamp_s: float
    source: str
    port: int
    payload: bytes


class Capture:
    """Datagrams of a file, in its order; packets of other protocols are skipped.

    Attributes:
        flow: source and port of the datagrams wanted; None selects all.
        flaw: reason why the last pass ended before the end of the file; None if it did not.
    """

    def __init__(self, path: Path) -> None:
        """Read the head of the file.

        Raises:
            MisuseError: the file cannot be read or is no PCAP file.
        """
        self.path = path
        self.flow: tuple[str, int] | None = None
        self.flaw: str | None = None
        try:
            with path.open("rb") as file:
                head = file.read(24)
        except OSError as error:
            raise MisuseError(path, f"cannot be read ({error.strerror})", "give a PCAP file") from None
        if head[:4] == PCAPNG:
            raise MisuseError(path, "is a pcapng file", "convert it: editcap -F pcap IN OUT")
        if head[:4] not in MAGICS or len(head) < 24:
            raise MisuseError(path, "is no PCAP file", "record one: tcpdump -w FILE udp")
        self._order, self._unit_s = MAGICS[head[:4]]
        self._link = struct.unpack_from(self._order + "I", head, 20)[0] & 0xFFFF
        if self._link != RAW_IP and self._link not in LINK_HEADERS:
            raise MisuseError(path, f"link type {self._link} is unknown", "record it on an Ethernet interface")

    def __iter__(self) -> Iterator[Datagram]:
        self.flaw, fragments = None, Fragments()
        with self.path.open("rb") as file:
            file.seek(24)
            for stamp_s, frame in self._records(file):
                start = self._start_of_ip(frame)
                source, protocol, payload = (start is not None and fragments.whole(frame[start:])) or ("", 0, b"")
                if protocol != UDP or len(payload) < 8:
                    continue
                port, length = struct.unpack_from(">HH", payload, 2)
                if self.flow in (None, (source, port)):
                    yield Datagram(stamp_s, source, port, payload[8 : length or None])

    def _records(self, file: BinaryIO) -> Iterator[tuple[float, bytes]]:
        """Stamp [s] and bytes of each record up to the first broken one."""
        header = struct.Struct(self._order + "IIII")
        while head := file.read(header.size):
            if len(head) < header.size:
                self.flaw = "truncated within the header of a record"
                return
            second, fraction, length, _ = header.unpack(head)
            if length > MAX_RECORD_BYTES:
                self.flaw = f"a record promises {length} bytes: the rest of the file is not read"
                return
            frame = file.read(length)
            if len(frame) < length:
                self.flaw = "truncated within a record"
                return
            yield second + fraction * self._unit_s, frame

    def _start_of_ip(self, frame: bytes) -> int | None:
        """Offset of the IP header, None where there is none."""
        if self._link == RAW_IP:
            return 0
        protocol_at, start = LINK_HEADERS[self._link]
        while len(frame) >= start:
            protocol = int.from_bytes(frame[protocol_at : protocol_at + 2], "big")
            if protocol not in VLAN_TAGS:
                return start if protocol in IPS else None
            protocol_at, start = start + 2, start + 4
        return None


class PacketStream:
    """Frames of one sensor's packets in a PCAP file; their number is known after they have been read.

    Attributes:
        info, faults: as in Stream.
        capture, decoder: datagrams of the sensor, and their decoder.
        reception: counts of the last pass.
    """

    def __init__(self, info: StreamInfo, capture: Capture, decoder: PacketDecoder, first: int = 0) -> None:
        """Select the frames with first <= index < info.end; each pass decodes with a fresh copy of the decoder."""
        self.info, self.faults, self.reception = info, Faults(), Reception()
        self.capture, self.decoder, self._first = capture, decoder, first

    def __iter__(self) -> Iterator[Frame]:
        self.reception = reception = Reception()
        stamps, path, lost, index = StampCheck(), str(self.capture.path), 0, -1
        sweeps = islice(_decoded(self.capture, self.decoder.again(), reception), self.info.end)
        for index, (arrived_s, sweep) in enumerate(sweeps):
            missing, lost = reception.lost - lost, reception.lost
            if index < self._first:
                stamps.doubt(sweep.stamp_s, arrived_s)
                continue
            flaws = [f"{missing} packets are missing"] if missing else []
            if frame := stamps.frame(sweep, arrived_s, index, path, self.faults, flaws):
                yield frame
        if index + 1 != self.info.end:  # the file was read to its end
            refused = [f"{count} packets refused: {reason}" for reason, count in reception.refused.items()]
            for flaw in [*refused, *filter(None, [self.capture.flaw])]:
                self.faults.report(index + 1, path, flaw, skipped=False)

    def between(self, first: int, last: int | None) -> Self:
        """Frames with first <= index < last; the file is read up to the last one."""
        first, end = max(first, self._first), min((k for k in (last, self.info.end) if k is not None), default=None)
        info = replace(self.info, end=end, n_frames=0 if end is not None and end <= first else None)
        return type(self)(info, self.capture, self.decoder, first)


def open_capture(path: Path, options: Mapping[str, str]) -> PacketStream:
    """Stream of the sensor whose packets come first in a PCAP file.

    `options` may name model and calibration of a Velodyne, the calibration of a Hesai, or the file with the metadata
    of an Ouster. The last two default to files with the name of the capture and the suffix .csv or .json.

    Raises:
        MisuseError: no PCAP file, no packets of a sensor, no whole sweep; an invalid option, a missing extra.
    """
    capture = Capture(path)
    if "model" not in options:
        options = _beside(path, metadata=".json") | dict(options)
    maker = _maker(capture, options)
    if maker == "hesai":
        options = _beside(path, calibration=".csv") | dict(options)
    decoder, layout = decoder_for(maker, path.stem, options), maker.capitalize()
    capture.flow = next(((d.source, d.port) for d in capture if decoder.accepts(d.payload)), None)
    if capture.flow is None:
        seen = Counter(f"{len(d.payload)} bytes to port {d.port}" for d in capture)
        there = f"{seen.total()} UDP datagrams, mostly of {seen.most_common(1)[0][0]}" if seen else "no UDP datagram"
        if layout == "Ouster":
            remedy = "give the metadata of the sensor that sent them"
        else:
            remedy = f"for an Ouster, save its metadata as {path.with_suffix('.json')} or give metadata=FILE"
        raise MisuseError(path, f"no packets of a {layout} ({there})", remedy)
    reception = Reception()
    _, first = next(_decoded(capture, decoder, reception), (0.0, None))
    if first is None:
        why, _, remedy = max(reception.refused, key=reception.refused.__getitem__, default="").partition("; ")
        cause = f"no whole sweep ({layout})" + (f", packets are refused: {why}" if why else "")
        raise MisuseError(path, cause, remedy or "record at least two turns of the sensor")
    info = decoder.info(path.stem, layout)
    return PacketStream(replace(info, period_s=round(first.turn_s, 3) or info.period_s), capture, decoder)


def _beside(path: Path, **suffixes: str) -> dict[str, str]:
    """Options whose files have the name of the capture, where they exist."""
    files = {option: path.with_suffix(suffix) for option, suffix in suffixes.items()}
    return {option: str(file) for option, file in files.items() if file.is_file()}


def _maker(capture: Capture, options: Mapping[str, str]) -> str:
    """Maker of the sensor whose packets come first."""
    if "metadata" in options:
        return "ouster"
    for datagram in capture if "model" not in options else ():
        if velodyne.signature_of(datagram.payload):
            break
        if hesai.model_of(datagram.payload):
            return "hesai"
        if livox.is_packet(datagram.payload):
            return "livox"
    return "velodyne"


def _decoded(capture: Capture, decoder: PacketDecoder, reception: Reception) -> Iterator[tuple[float, Sweep]]:
    """Time of the completing packet [s] and sweep, in the order of the capture."""
    arrived_s = 0.0
    for datagram in capture:
        reception.messages += 1
        arrived_s = datagram.stamp_s
        for sweep in decoder.decode(arrived_s, datagram.payload, reception):
            yield arrived_s, sweep
    for sweep in decoder.finish(reception):
        yield arrived_s, sweep
