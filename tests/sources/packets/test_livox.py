"""Packets of a Livox, by bytes written as its protocol lays them out."""

import struct

import numpy as np
import pytest

from modt.sources.drivers.livox import LivoxDecoder
from tests.sources.packets.simulated import BEGAN_S, decoded

STEP_S = 480e-6
"""Interval between the packets of a Mid-360 [s]."""


def packet(at_s, points, kind=1):
    """A packet by the offsets of the public protocol; points as bytes."""
    body = b"".join(points)
    out = bytearray(36)
    out[0] = 0  # version
    out[1:3] = struct.pack("<H", 36 + len(body))
    out[3:5] = struct.pack("<H", 4752)  # from the first to the last point [0.1 us]
    out[5:7] = struct.pack("<H", len(points))
    out[7:9] = struct.pack("<H", 1234)  # number of the packet
    out[10] = kind
    out[28:36] = struct.pack("<Q", round(at_s * 1e9))
    return bytes(out) + body


def timed(n, begin_s=7.0, **said):
    point = struct.pack("<iiiBB", 1500, -2500, 250, 51, 0)
    times_s = [begin_s + STEP_S * k for k in range(n)]
    return [(BEGAN_S + at_s, packet(at_s, **{"points": [point] * 96} | said)) for at_s in times_s]


@pytest.mark.parametrize(
    ("kind", "point", "xyz"),
    [
        (1, struct.pack("<iiiBB", 1500, -2500, 250, 51, 0), (1.5, -2.5, 0.25)),
        (2, struct.pack("<hhhBB", 150, -250, 25, 51, 0), (1.5, -2.5, 0.25)),
        (3, struct.pack("<IHHBB", 2000, 9000, 27000, 51, 0), (0.0, -2.0, 0.0)),
        (3, struct.pack("<IHHBB", 2000, 6000, 0, 51, 0), (np.sqrt(3), 0.0, 1.0)),
    ],
)
def test_each_data_type_is_decoded(kind, point, xyz):
    sweeps, reception = decoded(LivoxDecoder("sensor"), timed(700, points=[point] * 3, kind=kind))
    assert (len(sweeps), reception.lost, reception.refused) == (2, 0, {})
    for k, sweep in enumerate(sweeps):
        assert sweep.complete
        assert sweep.turn_s == 0.0
        assert sweep.stamp_s == pytest.approx(BEGAN_S + 7.15 + 0.1 * k, abs=1e-6)
        assert len(sweep.points) == pytest.approx(3 * 0.1 / STEP_S, abs=3)
        assert sweep.points[:, :3] == pytest.approx(np.tile(xyz, (len(sweep.points), 1)), abs=1e-6)
        assert sweep.points[:, 3] == pytest.approx(0.2)


@pytest.mark.parametrize(("tag", "kept"), [(0, True), (0x15, True), (0x02, False), (0x08, False), (0x20, False)])
def test_points_without_a_return_or_of_low_confidence_are_left_out(tag, kept):
    sound = struct.pack("<iiiBB", 4000, 0, 0, 0, 0)
    other = struct.pack("<iiiBB", 1000, 0, 0, 0, tag)
    none = bytes(14)
    (sweep, *_), _ = decoded(LivoxDecoder("sensor"), timed(500, points=[sound, other, none]))
    assert set(sweep.points[:, 0].tolist()) == ({1.0, 4.0} if kept else {4.0})


def test_a_clock_that_is_set_or_a_silence_costs_the_sweep_under_way():
    for step_s in (-5.0, 5.0, 1e5):
        later = [(at_s + 5.0, p) for at_s, p in timed(1100, 8.0 + step_s)]
        sweeps, reception = decoded(LivoxDecoder("sensor"), [*timed(1100), *later])
        assert len(sweeps) in (8, 9)
        assert all(s.complete for s in sweeps)
        assert reception.lost == 0


MM = (1500, -2500, 250)
SPHERICAL = (2926, 8510, 30096)  # mm, 0.01 deg


def old_packet(at_s, kind, body, form=0):
    """A packet of the first SDK: version 5, type of the time, data type, time, points."""
    micros = round(at_s * 1e6)
    stamp = struct.pack("<Q", micros * 1000)
    if form == 3:
        stamp = bytes((26, 11, 29, micros // 3_600_000_000)) + struct.pack("<I", micros % 3_600_000_000)
    return bytes((5, 0, 1, 0, 0, 0, 0, 0, form, kind)) + stamp + body


def echo(tag=0):
    return struct.pack("<iiiBB", *MM, 51, tag)


@pytest.mark.parametrize("form", [0, 3])
@pytest.mark.parametrize(
    ("kind", "body"),
    [
        (0, struct.pack("<iiiB", *MM, 51) * 100),
        (1, struct.pack("<IHHB", *SPHERICAL, 51) * 100),
        (2, echo() * 96),
        (3, struct.pack("<IHHBB", *SPHERICAL, 51, 0x20) * 96),
        (4, (struct.pack("<iiiBB", 9, 9, 9, 7, 0x10) + echo(0x20)) * 48),
        (5, (struct.pack("<HHIBB", *SPHERICAL[1:], 9, 7, 0) + struct.pack("<IBB", 2926, 51, 0)) * 48),
        (7, (echo() + struct.pack("<iiiBB", 9, 9, 9, 7, 1) + bytes(14)) * 30),
        (8, (struct.pack("<HHIBB", *SPHERICAL[1:], 2926, 51, 0) + bytes(12)) * 30),
    ],
)
def test_each_data_type_of_an_avia_is_decoded(kind, body, form):
    times_s = [3600.0 * 7 + 400e-6 * k for k in range(700)]
    decoder = LivoxDecoder("sensor")
    sweeps, reception = decoded(decoder, [(BEGAN_S + t, old_packet(t, kind, body, form)) for t in times_s])
    assert (decoder.profile, len(sweeps), reception.lost, reception.refused) == ("avia", 1, 0, {})
    assert sweeps[0].points[:, :3] == pytest.approx(np.tile([1.5, -2.5, 0.25], (len(sweeps[0].points), 1)), abs=2e-3)
    assert sweeps[0].points[:, 3] == pytest.approx(0.2)


def test_noise_of_an_avia_is_left_out_and_other_packets_are_refused():
    body = (echo() + echo(0x01) + echo(0x04) + echo(0x33)) * 24
    times_s = [400e-6 * k for k in range(700)]
    timed_avia = [(BEGAN_S + t, old_packet(t, 2, body)) for t in times_s]
    imu = old_packet(0.01, 6, bytes(24))
    sweeps, reception = decoded(LivoxDecoder("sensor"), [*timed_avia, (BEGAN_S + 1, imu), (BEGAN_S + 1, body[:-1])])
    assert len(sweeps[0].points) == 250 * 48
    assert (sweeps[0].delay_s.min(), sweeps[0].delay_s.max()) == pytest.approx((-0.05, 0.05), abs=1e-3)
    assert reception.refused == {"no packet of points of a Livox": 2}


def test_a_hap_is_told_by_its_pace():
    def hap(at_s):
        whole = packet(at_s, [echo(0x20)] * 95 + [echo(0x01)])  # a second return, and noise
        return whole[:3] + struct.pack("<H", 2102) + whole[5:]

    decoder = LivoxDecoder("sensor")
    sweeps, _ = decoded(decoder, [(BEGAN_S + t, hap(t)) for t in np.arange(1500) * 212.4e-6])
    assert decoder.profile == "hap"
    assert len(sweeps[0].points) == pytest.approx(0.1 / 212.4e-6 * 95, abs=95)
