"""RoboSense's packets, as captured and live."""

import socket

import numpy as np
import pytest

from modt.errors import MisuseError
from modt.schemes import open_sensor
from modt.sources.capture import open_capture
from modt.sources.drivers.robosense import REMEDY, RobosenseDecoder, angles_of, read_angles, signature_of
from modt.sources.live.packets import PacketReader, bound_socket
from tests.sources.packets.robosense_packets import FIRST_S, RANGE_M, TURN_S, WRITTEN
from tests.sources.packets.simulated import BEGAN_S, assert_whole_turn, clockwise_rad, decoded
from tools.send.pcap_writer import ethernet, ipv4, udp, write_capture

PROFILES = {"helios-16": "rs-16", "bpearl 4": "bpearl", "airy-48": None}


def told(name, returns=1):
    decoder = RobosenseDecoder("sensor")
    assert decoder.describe(WRITTEN[name].difop(returns))
    return decoder


@pytest.mark.parametrize("returns", [1, 2])
@pytest.mark.parametrize("name", WRITTEN)
def test_each_model_is_decoded_by_the_angles_that_it_tells(name, returns):
    model = WRITTEN[name]
    decoder = told(name, returns)
    (sweep,), reception = decoded(decoder, model.turns(1.7, returns))
    assert decoder.profile == PROFILES.get(name, name)
    assert_whole_turn(sweep, reception, TURN_S, BEGAN_S + FIRST_S + TURN_S)
    x, y, z, _ = sweep.points.T
    forward_m, up_m = model.lens_m
    assert np.sqrt(x * x + y * y + (z - up_m) ** 2) == pytest.approx(RANGE_M, abs=forward_m + 1e-3)
    assert len(x) == pytest.approx(TURN_S / model.firing_s * model.beams, rel=0.01)
    angles = model.angles_deg()
    assert decoder.elevations_deg == pytest.approx([elevation for elevation, _ in angles], abs=0.01)
    seen_deg = np.unique(np.rad2deg(np.arctan2(z, np.hypot(x, y))).round(2))
    expected = sorted({model.elevation_deg(*both) for both in angles})
    assert np.abs(seen_deg[:, None] - expected).min(axis=0) == pytest.approx(0.0, abs=0.02)
    lowest = min(angles)
    one = np.abs(np.rad2deg(np.arctan2(z, np.hypot(x, y))) - model.elevation_deg(*lowest)) < 0.01
    steps = np.diff(clockwise_rad(x[one], y[one]))
    assert steps == pytest.approx(np.full(len(steps), -model.firing_s / TURN_S * 2 * np.pi), abs=1e-3)


@pytest.mark.parametrize("name", WRITTEN)
def test_the_brightest_of_two_returns_is_taken(name):
    timed = WRITTEN[name].turns(1.7, 2, cells=((3.0, 10), (7.0, 90)))
    (sweep,), _ = decoded(told(name, 2), timed)
    assert sweep.points[:, 3] == pytest.approx(90 / 255)


def test_an_rs_16_without_difop_has_its_nominal_angles_and_others_are_refused(caplog):
    decoder = RobosenseDecoder("sensor")
    (sweep,), _ = decoded(decoder, WRITTEN["rs-16"].turns(1.7))
    assert sweep.complete
    assert "beams as of any RS-16" in caplog.text
    timed = WRITTEN["helios-32"].turns(1.7)
    decoder = RobosenseDecoder("sensor")
    sweeps, reception = decoded(decoder, timed)
    assert (sweeps, reception.refused) == (
        [],
        {f"the angles of this Helios are not known; {REMEDY}": len(timed)},
    )
    assert decoder.describe(WRITTEN["helios-32"].difop())
    sweeps, _ = decoded(decoder, timed)  # once it has told them
    assert len(sweeps) == 1


def test_angles_from_a_file(tmp_path):
    path = tmp_path / "angles.csv"
    path.write_text("".join(f"{elevation},{aside}\n" for elevation, aside in WRITTEN["helios-32"].angles_deg()))
    decoder = RobosenseDecoder("sensor", read_angles(path))
    assert not decoder.describe(b"x")
    (from_file,), _ = decoded(decoder, WRITTEN["helios-32"].turns(1.7))
    (told_by_it,), _ = decoded(told("helios-32"), WRITTEN["helios-32"].turns(1.7))
    assert from_file.points.tobytes() == told_by_it.points.tobytes()
    for text in ("1,2\n", "a,b\n" * 16, "99\n" * 16, "nan\n" * 16):
        path.write_text(text)
        with pytest.raises(MisuseError, match="no calibration of a RoboSense"):
            read_angles(path)


def test_a_bpearl_that_turns_the_other_way_is_mirrored():
    model = WRITTEN["bpearl"]
    decoder = RobosenseDecoder("sensor")
    difop = bytearray(model.difop())
    (right,), _ = decoded(told("bpearl"), model.turns(1.7))
    difop[337] = 1
    assert decoder.describe(bytes(difop))
    (left,), _ = decoded(decoder, model.turns(1.7))
    assert left.turn_s == 0.0  # not deskewed
    assert np.array_equal(left.points, right.points * [1, -1, 1, 1])


def test_hostile_packets_are_refused(rng):
    model = WRITTEN["helios-32"]
    whole = model.packet(FIRST_S)
    assert signature_of(whole) is not None
    assert signature_of(whole[:-1]) is None
    assert signature_of(bytes(1248)) is None
    assert signature_of(whole[:44] + b"\xff\xff" + whole[46:]) is None
    for name, written in WRITTEN.items():
        decoder = told(name)
        difop = written.difop()
        known = signature_of(written.packet(FIRST_S))
        for raw in (difop[:-1], b"", rng.bytes(1248)):
            assert not decoder.describe(raw)
        assert angles_of(bytes(1248), known) is None
        assert angles_of(difop[:8] + b"\xff" * 1240, known) is None
        decoder.describe(difop[:8] + rng.bytes(1240))
        sweeps, _ = decoded(decoder, written.turns(2.7))
        assert all(np.isfinite(sweep.points).all() for sweep in sweeps)


def mixed(path, name, difop):
    """A capture of points and, at another port, DIFOP."""
    write_capture(path, WRITTEN[name].turns(2.7), 6699)
    if difop:
        frame = ethernet(ipv4(udp(WRITTEN[name].difop(), 7788)))
        with path.open("ab") as file:
            file.write(np.array([BEGAN_S + FIRST_S + 1, 0, len(frame), len(frame)], "<u4").tobytes() + frame)


def test_a_capture_is_read_with_the_angles_that_the_sensor_tells_on_another_port(tmp_path):
    path = tmp_path / "a.pcap"
    mixed(path, "helios-32", difop=True)
    stream = open_capture(path, {})
    assert (stream.info.layout, stream.info.profile, stream.info.period_s) == ("RoboSense packets", "helios-32", 0.1)
    assert len(list(stream)) == 2
    assert [len(frame.points) for frame in stream.between(1, None)] == [len(list(stream)[1].points)]
    mixed(path, "helios-32", difop=False)
    with pytest.raises(
        MisuseError, match=r"no whole sweep \(RoboSense\), packets are refused: the angles.*"
    ) as raised:
        open_capture(path, {})
    assert raised.value.remedy == REMEDY


def test_a_capture_of_a_model_that_is_not_decoded_names_it(tmp_path):
    ruby = bytes.fromhex("55aa055a") + bytes(1244)
    write_capture(tmp_path / "a.pcap", [(1.0, ruby)] * 30, 6699)
    with pytest.raises(MisuseError, match=r"RoboSense that is not decoded.*ros2://"):
        open_capture(tmp_path / "a.pcap", {})


def test_a_live_sensor_tells_its_angles_on_another_port(ports, request):
    port, difop_port = ports
    decoder = RobosenseDecoder("sensor")
    reader = PacketReader(bound_socket("sensor", port), decoder, "127.0.0.1", clock=lambda: 0.0)  # no packet is late
    reader.descriptions = bound_socket("sensor", difop_port)
    request.addfinalizer(reader.close)
    timed = WRITTEN["helios-32"].turns(1.7)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
        sender.sendto(WRITTEN["helios-32"].difop(), ("127.0.0.1", difop_port))
        for _, payload in timed[:10]:
            sender.sendto(payload, ("127.0.0.1", port))
        sweeps = list(reader.read(0.0))
        for _, payload in timed[10:]:
            sender.sendto(payload, ("127.0.0.1", port))
            sweeps += reader.read(0.0)
    assert len(decoder.finish()) + len(sweeps) == 1
    reader.close()
    with pytest.raises(MisuseError, match="'0' is no port"):
        open_sensor(f"robosense://127.0.0.1:{port}?difop=0")
