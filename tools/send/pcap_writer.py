"""Packets to a PCAP file."""

from __future__ import annotations

import struct
from collections.abc import Iterable
from pathlib import Path

from tools.send.faults import Timed

ETHERNET = 1


def write_capture(path: Path, packets: Iterable[Timed], port: int) -> None:
    """Write payloads sent to a UDP port as Ethernet frames; times are those of the records."""
    with path.open("wb") as file:
        file.write(struct.pack("<IHHiIII", 0xA1B2C3D4, 2, 4, 0, 0, 262_144, ETHERNET))
        for at_s, payload in packets:
            frame = ethernet(ipv4(udp(payload, port)))
            second, fraction = divmod(round(at_s * 1e6), 10**6)
            file.write(struct.pack("<IIII", second, fraction, len(frame), len(frame)) + frame)


def udp(payload: bytes, port: int) -> bytes:
    """A UDP datagram."""
    return struct.pack(">HHHH", port, port, 8 + len(payload), 0) + payload


def ipv4(payload: bytes, *, identity: int = 0, offset: int = 0, more: bool = False) -> bytes:
    """An IPv4 packet from 192.0.2.1, or a fragment of one at an offset [bytes]."""
    flags = more << 13 | offset // 8
    head = struct.pack(">BBHHHBBH", 0x45, 0, 20 + len(payload), identity, flags, 64, 17, 0)
    return head + bytes((192, 0, 2, 1)) + bytes((255, 255, 255, 255)) + payload


def ethernet(packet: bytes) -> bytes:
    """An Ethernet frame of an IPv4 packet."""
    return bytes(12) + b"\x08\x00" + packet
