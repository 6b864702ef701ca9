"""Packets over loopback."""

from __future__ import annotations

import socket
import threading
import time
from contextlib import suppress

import pytest

from modt.errors import MisuseError
from modt.schemes import open_sensor
from modt.sources.live.packets import PacketReader, address_of, bound_socket
from modt.sources.packets.capture import open_capture
from modt.sources.packets.hesai import HesaiDecoder
from modt.sources.packets.livox import LivoxDecoder
from modt.sources.packets.velodyne import VelodyneDecoder
from modt.sources.stream import Reception
from tests.sources.packets.simulated import packets
from tools.send.loops import endless
from tools.send.packets import send
from tools.send.pcap_writer import write_capture

MAKERS = {"vlp-16": "velodyne", "xt-32": "hesai", "mid-360": "livox"}
"""Schemes of simulated models."""


@pytest.fixture
def port():
    """A port that is free."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("", 0))
        return probe.getsockname()[1]


@pytest.fixture
def to(port):
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
        sender.connect(("127.0.0.1", port))
        yield sender


def now():
    """A time within a minute of the present one."""
    return pytest.approx(time.time(), abs=60.0)


class EchoDecoder:
    """Each packet is a sweep."""

    name, profile, elevations_deg = "sensor", None, None

    def decode(self, received_s: float, payload: bytes, reception: Reception) -> list[object]:
        return [(received_s, payload)]

    def pause(self, reception: Reception) -> list[object]:
        return []


def test_a_group_is_joined_and_what_is_none_is_refused(port):
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        if probe.connect_ex(("239.7.7.7", port)):
            pytest.skip("no route to a multicast group")
    reader = PacketReader(bound_socket("sensor", port, "239.7.7.7"), EchoDecoder())
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
        sender.sendto(b"packet", ("239.7.7.7", port))
    assert reader.read(60.0) == [(now(), b"packet")]
    reader.close()
    for group in ("10.0.0.1", "nowhere"):
        with pytest.raises(MisuseError, match=f"group {group} cannot be joined"):
            bound_socket("sensor", port, group)


def test_packets_are_as_of_when_the_kernel_received_them(port, to):
    reader = PacketReader(bound_socket("sensor", port), EchoDecoder())
    for _ in range(100):  # the kernel begins to take times a little after it was asked to
        sent_s = time.time()
        to.send(b"packet")
        time.sleep(0.05)
        read_s = time.time()
        ((received_s, _),) = reader.read(60.0)
        if received_s < read_s:
            break
    reader.close()
    assert sent_s <= received_s < read_s


def test_packets_that_waited_for_a_stopped_process_are_discarded(port, to, caplog):
    later_s = [6.0]
    reader = PacketReader(bound_socket("sensor", port), EchoDecoder(), clock=lambda: time.time() + later_s[0])
    to.send(b"old")
    assert reader.read(0.2) == []
    later_s[0] = 0.0
    to.send(b"new")
    assert [payload for _, payload in reader.read(60.0)] == [b"new"]
    reader.close()
    assert sum(reader.reception.refused.values()) == 1
    assert "packet refused: late: this process was stopped" in caplog.text


def test_packets_of_another_address_are_refused(port, to):
    reader = PacketReader(bound_socket("sensor", port), EchoDecoder(), "192.0.2.1")
    to.send(b"packet")
    assert reader.read(0.2) == []
    reader.close()
    assert reader.reception.refused == {"from another address than the sensor's": 1}


def test_closing_ends_a_read(port):
    reader = PacketReader(bound_socket("sensor", port), EchoDecoder())
    ended = threading.Event()

    def read():
        with suppress(OSError):
            reader.read(60.0)
        ended.set()

    thread = threading.Thread(target=read)
    thread.start()
    while not ended.wait(0.05) and reader._socket.fileno() >= 0:
        reader.close()
    assert ended.wait(60.0)
    thread.join()


def test_a_small_buffer_is_said(port, monkeypatch, caplog):
    monkeypatch.setattr("modt.sources.live.packets.BUFFER_BYTES", 2**30)
    bound_socket("sensor", port).close()
    (record,) = caplog.records
    assert "granted, 1073741824 asked; sysctl -w net.core.rmem_max=1073741824" in record.message


def test_what_cannot_be_bound_or_found_is_refused(port):
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as other:
        other.bind(("", port))
        with pytest.raises(MisuseError, match=f"port {port} cannot be bound"):
            bound_socket("sensor", port)
    with pytest.raises(MisuseError, match=r"host nowhere\.invalid is unknown"):
        address_of("sensor", "nowhere.invalid")


def received(address, timed, to, n):
    """The first n sweeps of a live stream, its packets with the times of their reception, and the closed stream.

    Each packet is sent when the one before has been received, and nothing counts as late on a busy machine.
    """
    live, arrived, frames = open_sensor(address), [], []
    live._clock = live.reader._clock = lambda: 0.0
    decode = live.reader.decoder.decode

    def noted(received_s, payload, reception):
        arrived.append((received_s, payload))
        return decode(received_s, payload, reception)

    def take(timeout_s):
        if (taken := live.take(timeout_s)) is not None:
            frames.append(taken.frame)

    def one_by_one():
        until_s = time.monotonic() + 120
        for k, packet in enumerate(timed, 1):
            yield packet
            while live.health()["messages"] < k and time.monotonic() < until_s:
                time.sleep(0.0002)
            take(0.0)

    live.reader.decoder.decode = noted
    live.start()
    send(one_by_one(), to)
    for _ in range(n - len(frames)):
        take(60.0)
    live.close()
    del live.reader.decoder.decode
    return frames, arrived, live


@pytest.mark.parametrize("model", MAKERS)
def test_sweeps_over_loopback_are_those_of_the_file(model, port, to, tmp_path):
    if MAKERS[model] == "velodyne":
        pytest.importorskip("velodyne_decoder", reason="needs the extra [velodyne]")
    timed = packets(model)[:-5]  # a file's last sweep does not wait for the packet after it
    write_capture(tmp_path / "drive.pcap", timed, port)
    began_s = timed[0][0]
    file = list(open_capture(tmp_path / "drive.pcap", {}))
    timed = [(at_s - began_s, payload) for at_s, payload in timed]
    frames, arrived, live = received(f"{MAKERS[model]}://127.0.0.1:{port}", timed, to, len(file))
    assert [f.points.tobytes() for f in frames] == [f.points.tobytes() for f in file]
    decoder, sweeps = live.reader.decoder.again(), []
    for received_s, payload in arrived:
        sweeps += decoder.decode(received_s, payload, Reception())
    assert [f.stamp_s for f in frames[: len(sweeps)]] == [s.stamp_s for s in sweeps[: len(frames)]]
    assert frames[-1].stamp_s == now()
    assert live.reader.profile == model
    health = live.health()
    assert (health["messages"], health["lost_messages"], health["refused_messages"]) == (len(timed), 0, {})
    assert (health["sweeps"], health["incomplete_sweeps"], health["dropped_sweeps"]) == (len(file), 0, 0)


@pytest.mark.kitti
def test_an_ouster_over_loopback_is_that_of_the_file(port, to, kitti_root):
    pytest.importorskip("ouster.sdk.core", reason="needs the extra [ouster]")
    metadata = kitti_root / "ouster" / "OS-1-128_v2.3.0_1024x10.json"
    stream = open_capture(kitti_root / "ouster" / "OS-1-128_v2.3.0_1024x10_lb_n3.pcap", {"metadata": str(metadata)})
    timed = [(0.0016 * k, d.payload) for k, d in enumerate(stream.capture)]
    file = list(stream)
    frames, _, live = received(f"ouster://127.0.0.1:{port}?metadata={metadata}", timed, to, len(file))
    assert [f.points.tobytes() for f in frames] == [f.points.tobytes() for f in file]
    assert live.info.profile == "os1-128"
    assert live.reader.reception.lost == 0


def test_an_ouster_needs_its_metadata():
    with pytest.raises(MisuseError, match=r"metadata; write ouster://HOST.*\?metadata=FILE"):
        open_sensor("ouster://:7502")


@pytest.mark.parametrize(
    ("model", "made", "n"),
    [("vlp-16", VelodyneDecoder, 900), ("xt-32", HesaiDecoder, 3000), ("mid-360", LivoxDecoder, 1000)],
)
def test_a_loop_has_no_gap(model, made, n):
    if made is VelodyneDecoder:
        pytest.importorskip("velodyne_decoder", reason="needs the extra [velodyne]")
    decoder, reception, sweeps = made("loop"), Reception(), []
    for _, (at_s, payload) in zip(range(n), endless([p for _, p in packets(model)]), strict=False):
        sweeps += decoder.decode(at_s, payload, reception)
    assert reception.lost == 0
    assert len(sweeps) in (10, 11)
    assert all(s.complete for s in sweeps)
