"""PCAP files: what is read, and what is refused."""

import struct

import pytest
from hypothesis import given
from hypothesis import strategies as st

from modt.errors import MisuseError
from modt.sources.packets.ip_packets import Fragments
from modt.sources.packets.pcap_file import COOKED, COOKED_2, ETHERNET, MAX_RECORD_BYTES, RAW_IP, PcapFile
from tests.sources.packets import pcapng
from tools.send.pcap_writer import ethernet, ipv4, udp

PAYLOADS = [b"first", b"", bytes(range(256)) * 5]
DATAGRAM = ipv4(udp(b"payload", 2368))


RECORD = struct.pack("<IIII", 8, 0, len(ethernet(DATAGRAM)), len(ethernet(DATAGRAM))) + ethernet(DATAGRAM)
ABSURD = struct.pack("<IIII", 8, 0, MAX_RECORD_BYTES + 1, 10) + bytes(10)


def file_of(path, frames, *, order="<", magic=0xA1B2C3D4, link=ETHERNET):
    head = struct.pack(order + "IHHiIII", magic, 2, 4, 0, 0, 65_535, link)
    records = (struct.pack(order + "IIII", 7, 250_000, len(f), len(f)) + f for f in frames)
    path.write_bytes(head + b"".join(records))
    return path


def payloads(path):
    return [d.payload for d in PcapFile(path)]


@pytest.mark.parametrize("order", ["<", ">"])
@pytest.mark.parametrize(("magic", "stamp_s"), [(0xA1B2C3D4, 7.25), (0xA1B23C4D, 7.00025)])
def test_either_byte_order_and_unit(tmp_path, order, magic, stamp_s):
    frames = [ethernet(ipv4(udp(p, 2368))) for p in PAYLOADS]
    read = list(PcapFile(file_of(tmp_path / "a.pcap", frames, order=order, magic=magic)))
    assert [d.payload for d in read] == PAYLOADS
    assert [d.stamp_s for d in read] == pytest.approx([stamp_s] * 3, abs=1e-9)
    assert {(d.source, d.port) for d in read} == {("192.0.2.1", 2368)}


SOURCES = {4: "192.0.2.1", 6: "fe80::c901"}
SOURCE = bytes.fromhex("fe80000000000000000000000000c901")
WHOLE = udp(bytes(i % 251 for i in range(4000)), 7502)
EXTENSIONS = bytes((60, 0)) + bytes(6) + bytes((17, 1)) + bytes(14)


def ipv6(payload, *, kind=17):
    head = struct.pack(">IHBB", 6 << 28, len(payload), kind, 64)
    return head + SOURCE + bytes.fromhex("ff020000000000000000000000000001") + payload


PACKETS = {4: DATAGRAM, 6: ipv6(udp(b"payload", 2368))}
TYPES = {4: b"\x08\x00", 6: b"\x86\xdd"}


@pytest.mark.parametrize("version", [4, 6])
@pytest.mark.parametrize(
    ("link", "frame"),
    [
        (ETHERNET, lambda kind, packet: bytes(12) + kind + packet + b"padding"),
        (ETHERNET, lambda kind, packet: bytes(12) + b"\x81\x00\x00\x05" + kind + packet),
        (ETHERNET, lambda kind, packet: bytes(12) + b"\x88\xa8\x00\x05\x81\x00\x00\x06" + kind + packet),
        (RAW_IP, lambda kind, packet: packet),
        (COOKED, lambda kind, packet: bytes(14) + kind + packet),
        (COOKED_2, lambda kind, packet: kind + bytes(18) + packet),
    ],
    ids=["Ethernet", "VLAN", "two VLAN tags", "raw IP", "cooked", "cooked 2"],
)
def test_link_layers(tmp_path, link, frame, version):
    (read,) = PcapFile(file_of(tmp_path / "a.pcap", [frame(TYPES[version], PACKETS[version])], link=link))
    assert (read.source, read.port, read.payload) == (SOURCES[version], 2368, b"payload")


def test_extension_headers_of_ipv6_are_skipped(tmp_path):
    path = file_of(tmp_path / "a.pcap", [ipv6(EXTENSIONS + udp(b"payload", 2368), kind=0)], link=RAW_IP)
    assert payloads(path) == [b"payload"]


def fragment(version, at):
    piece = WHOLE[at : at + 1480]
    more = at + 1480 < len(WHOLE)
    if version == 4:
        return ipv4(piece, identity=9, offset=at, more=more)
    return ipv6(struct.pack(">BBHI", 17, 0, at | more, 9) + piece, kind=44)


@pytest.mark.parametrize("version", [4, 6])
def test_fragments_are_put_together_in_any_order(tmp_path, version):
    parts = [fragment(version, at) for at in range(0, 4008, 1480)]
    between = ipv4(udp(b"between", 7502))
    path = file_of(tmp_path / "a.pcap", [parts[2], parts[0], between, parts[1], parts[0]], link=RAW_IP)
    assert payloads(path) == [b"between", WHOLE[8:]]


@given(st.binary(max_size=200), st.sampled_from([0x45, 0x60, 0x6F]))
def test_any_bytes_are_a_packet_or_none(raw, first):
    Fragments().whole(bytes([first]) + raw)


def test_packets_that_hold_no_datagram_are_skipped(tmp_path):
    tcp = bytearray(DATAGRAM)
    tcp[9] = 6
    frames = [b"", b"short", bytes(12) + b"\x86\xdd" + bytes(60), ethernet(bytes(tcp)), ethernet(DATAGRAM[:24])]
    assert payloads(file_of(tmp_path / "a.pcap", [*frames, ethernet(DATAGRAM)])) == [b"payload"]


def test_only_the_flow_wanted_is_read(tmp_path):
    frames = [ethernet(ipv4(udp(b"a", 2368))), ethernet(ipv4(udp(b"b", 8308)))]
    capture = PcapFile(file_of(tmp_path / "a.pcap", frames))
    capture.flow = ("192.0.2.1", 8308)
    assert [d.payload for d in capture] == [b"b"]


@pytest.mark.parametrize(
    ("end", "flaw"),
    [*((RECORD[:at], "truncated") for at in (-1, -40, 13)), (ABSURD, "promises 262145 bytes")],
)
def test_a_file_is_read_up_to_its_broken_end(tmp_path, end, flaw):
    path = file_of(tmp_path / "a.pcap", [ethernet(DATAGRAM)])
    path.write_bytes(path.read_bytes() + end)
    capture = PcapFile(path)
    assert len(list(capture)) == 1
    (found,) = capture.flaws
    assert flaw in found


@pytest.mark.parametrize(
    ("raw", "cause"),
    [
        (b"", "no PCAP"),
        (b"\xd4\xc3\xb2\xa1", "no PCAP"),
        (b"garbage" * 10, "no PCAP"),
        (struct.pack("<IHHiIII", 0xA1B2C3D4, 2, 4, 0, 0, 65_535, 105), "link type 105"),
    ],
)
def test_another_file_is_refused(tmp_path, raw, cause):
    path = tmp_path / "a.pcap"
    path.write_bytes(raw)
    with pytest.raises(MisuseError, match=cause):
        PcapFile(path)


@pytest.mark.parametrize(("link", "head"), [(12, b""), (14, b""), (228, b""), (0, b"\2\0\0\0"), (108, b"\0\0\0\2")])
def test_ip_packets_of_any_link_are_read(tmp_path, link, head):
    assert payloads(file_of(tmp_path / "a.pcap", [head + DATAGRAM], link=link)) == [b"payload"]


@pytest.mark.parametrize("at", [0, 4, 8, 12])
@pytest.mark.parametrize("value", [0xFFFFFFFF, 70])
def test_records_behind_a_damaged_one_are_read(tmp_path, at, value):
    frames = [ethernet(ipv4(udp(bytes([k]) * 40, 2368))) for k in range(9)]
    path = file_of(tmp_path / "a.pcap", frames)
    raw = bytearray(path.read_bytes())
    struct.pack_into("<I", raw, 24 + 4 * (16 + len(frames[0])) + at, value)
    path.write_bytes(raw)
    capture = PcapFile(path)
    read = {d.payload[:1] for d in capture if len(d.payload) == 40}
    assert read >= {bytes([k]) for k in range(9)} - {b"\4", b"\5"}
    assert len(read) >= 8 or capture.flaws


def pcapng_file(path, *parts):
    path.write_bytes(b"".join(parts))
    return path


FRAMES = [ethernet(ipv4(udp(p, 2368))) for p in PAYLOADS]


@pytest.mark.parametrize("order", ["<", ">"])
@pytest.mark.parametrize(
    ("options", "per_s", "offset_s"),
    [
        ((), 10**6, 0),
        (((9, b"\x09"),), 10**9, 0),
        (((2, b"eth0"), (9, b"\x8a")), 2**10, 0),
        (((14, struct.pack("<q", 100)),), 10**6, 100),
    ],
)
def test_pcapng_in_either_byte_order_and_any_unit(tmp_path, order, options, per_s, offset_s):
    options = [(code, value[::-1] if code == 14 and order == ">" else value) for code, value in options]
    packets = [pcapng.packet(7 * per_s + per_s // 4, frame, order) for frame in FRAMES]
    statistics = pcapng.block(5, bytes(12), order)
    begin = pcapng.section(order, options=options)
    read = list(PcapFile(pcapng_file(tmp_path / "a.pcapng", begin, packets[0], statistics, *packets[1:])))
    assert [d.payload for d in read] == PAYLOADS
    assert [d.stamp_s for d in read] == pytest.approx([7.25 + offset_s] * 3)


def test_each_interface_and_section_of_pcapng_has_its_own_link(tmp_path):
    raw_ip = pcapng.block(1, struct.pack("<HHI", RAW_IP, 0, 0))
    first = [pcapng.section(), raw_ip, pcapng.packet(0, FRAMES[0]), pcapng.packet(1, DATAGRAM, interface=1)]
    second = [pcapng.section(">", link=RAW_IP), pcapng.packet(2, DATAGRAM, ">"), pcapng.packet(3, b"", ">", 5)]
    assert payloads(pcapng_file(tmp_path / "a.pcapng", *first, *second)) == [PAYLOADS[0], b"payload", b"payload"]


def test_pcapng_is_read_on_behind_damaged_bytes(tmp_path):
    packets = [pcapng.packet(k, FRAMES[k % 3]) for k in range(6)]
    packets[2] = b"\xee" * 30 + packets[2][30:]
    capture = PcapFile(pcapng_file(tmp_path / "a.pcapng", pcapng.section(), *packets, packets[0][:-9]))
    assert [d.payload for d in capture] == [PAYLOADS[k % 3] for k in (0, 1, 3, 4, 5)]
    assert [flaw.split(" at")[0].split(" from")[0] for flaw in capture.flaws] == ["damaged", "truncated or damaged"]


def test_datagrams_that_were_cut_short_are_counted(tmp_path):
    capture = PcapFile(file_of(tmp_path / "a.pcap", [frame[:100] for frame in FRAMES]))
    assert len(list(capture)) == 3
    assert capture.cut == 1
