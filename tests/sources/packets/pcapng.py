"""Captures in pcapng, for tests."""

import struct

from tools.send.pcap_writer import ETHERNET, ethernet, ipv4, udp


def block(kind, body, order="<"):
    body += bytes(-len(body) % 4)
    size = struct.pack(order + "I", 12 + len(body))
    return struct.pack(order + "I", kind) + size + body + size


def section(order="<", link=ETHERNET, options=b""):
    """Begin of a section with an interface; options are (code, value)."""
    begin = block(0x0A0D0D0A, struct.pack(order + "IHHq", 0x1A2B3C4D, 1, 0, -1), order)
    coded = b"".join(
        struct.pack(order + "HH", code, len(value)) + value + bytes(-len(value) % 4) for code, value in options
    )
    return begin + block(1, struct.pack(order + "HHI", link, 0, 262_144) + coded, order)


def packet(at, frame, order="<", interface=0):
    """A block of a packet, captured at a time in the unit of its interface."""
    head = struct.pack(order + "5I", interface, at >> 32, at & 0xFFFFFFFF, len(frame), len(frame))
    return block(6, head + frame, order)


def captured(timed, port):
    """A file of payloads that were sent to a UDP port at times [s]."""
    frames = ((round(at_s * 1e6), ethernet(ipv4(udp(payload, port)))) for at_s, payload in timed)
    return section() + b"".join(packet(at, frame) for at, frame in frames)
