"""Packets over loopback."""

import socket
import time
from itertools import islice

import pytest

from modt.errors import MisuseError
from modt.schemes import open_sensor
from modt.sources.drivers.hesai import HesaiDecoder
from modt.sources.drivers.livox import LivoxDecoder
from modt.sources.live.packets import TIMESPEC, PacketReader, address_of, bound_socket
from modt.sources.packets.packet_decoder import PacketDecoder
from modt.sources.stream import Sweep
from tests.sources.packets.simulated import decoded, packets
from tools.send.loops import endless


@pytest.fixture
def to(port):
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
        sender.connect(("127.0.0.1", port))
        yield sender


def now():
    """A time within a minute of the present one."""
    return pytest.approx(time.time(), abs=60.0)


class Echo(PacketDecoder):
    """A decoder whose sweeps hold a packet each, with the time of its reception."""

    def accepts(self, payload):
        return True

    def decode(self, received_s, payload):
        return [Sweep(received_s, payload)]

    def _reset(self):
        pass


@pytest.fixture(name="listen")
def listening(port, request):
    """A function that makes a reader of the port."""

    def listen(*group, **options):
        reader = PacketReader(bound_socket("sensor", port, *group), Echo("sensor"), **options)
        request.addfinalizer(reader.close)
        return reader

    return listen


def test_a_multicast_group_is_joined_and_another_address_is_refused(port, listen):
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        if probe.connect_ex(("239.7.7.7", port)):
            pytest.skip("no route to a multicast group")
    reader = listen("239.7.7.7")
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
        sender.sendto(b"packet", ("239.7.7.7", port))
    (sweep,) = reader.read(60.0)
    assert (sweep.stamp_s, sweep.points) == (now(), b"packet")
    reader.close()
    for group in ("10.0.0.1", "nowhere"):
        with pytest.raises(MisuseError, match=f"group {group} cannot be joined"):
            bound_socket("sensor", port, group)


def test_packets_have_the_time_at_which_the_kernel_received_them(listen, to):
    reader = listen()
    for _ in range(100):  # the kernel begins to take times a little after it was asked to
        sent_s = time.time()
        to.send(b"packet")
        time.sleep(0.05)
        read_s = time.time()
        (sweep,) = reader.read(60.0)
        if sweep.stamp_s < read_s:
            break
    assert sent_s <= sweep.stamp_s < read_s


def test_a_packet_has_waited_since_the_kernel_received_it(listen):
    reader = listen(clock=lambda: 1000.75)
    (sweep,) = reader._decoded(b"packet", [(0, 0, TIMESPEC.pack(1000, 500_000_000))], "127.0.0.1")
    assert (sweep.stamp_s, sweep.waited_s) == (1000.5, 0.25)


def test_packets_that_waited_for_a_stopped_process_are_discarded(listen, to, caplog):
    later_s = [6.0]
    reader = listen(clock=lambda: time.time() + later_s[0])
    to.send(b"old")
    assert reader.read(0.2) == []
    later_s[0] = 0.0
    to.send(b"new")
    assert [sweep.points for sweep in reader.read(60.0)] == [b"new"]
    assert sum(reader.reception.refused.values()) == 1
    assert "this process was stopped" in caplog.text


def test_packets_of_another_address_are_refused(listen, to):
    reader = listen(source="192.0.2.1")
    to.send(b"packet")
    assert reader.read(0.2) == []
    assert reader.reception.refused == {"from another address than the sensor's": 1}


def test_a_small_receive_buffer_is_warned_of(port, monkeypatch, caplog):
    monkeypatch.setattr("modt.sources.live.packets.BUFFER_BYTES", 2**30)
    bound_socket("sensor", port).close()
    assert "sysctl -w net.core.rmem_max=1073741824" in caplog.text


def test_a_port_or_host_that_cannot_be_used_is_refused(port):
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as other:
        other.bind(("", port))
        with pytest.raises(MisuseError, match=f"port {port} cannot be bound"):
            bound_socket("sensor", port)
    with pytest.raises(MisuseError, match=r"host nowhere\.invalid is unknown"):
        address_of("sensor", "nowhere.invalid")
    with pytest.raises(MisuseError, match=r"metadata; write ouster://HOST.*\?metadata=FILE"):
        open_sensor("ouster://:7502")


@pytest.mark.parametrize(("model", "made", "n"), [("xt-32", HesaiDecoder, 3000), ("mid-360", LivoxDecoder, 1000)])
def test_a_loop_has_no_gap(model, made, n):
    looped = endless([payload for _, payload in packets(model)])
    sweeps, reception = decoded(made("loop"), islice(looped, n))
    assert reception.lost == 0
    assert len(sweeps) in (10, 11)
    assert all(s.complete for s in sweeps)
