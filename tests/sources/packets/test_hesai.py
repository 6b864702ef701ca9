"""Hesai's packets, by bytes written as the manuals lay them out, and against another decoder."""

import socket
import struct
import threading
from dataclasses import dataclass

import numpy as np
import pytest

from modt.errors import MisuseError
from modt.sources.capture import open_capture
from modt.sources.drivers.hesai import GET_CALIBRATION, REMEDY, HesaiDecoder, asked_angles, model_of, read_angles
from tests.sources.packets.simulated import BEGAN_S, assert_whole_turn, clockwise_rad, decoded
from tools.send.pcap_writer import write_capture

TURN_S = 0.1
RANGE = 2500
"""Range of every point, in units."""


@dataclass(frozen=True)
class Written:
    """A model's packets: header, bytes before an azimuth, size of a channel, of blocks and channels, and tail.

    The tail is the return mode (m), year to second (d), microseconds (u), and numbers of other bytes.
    """

    header: str
    before: str
    cell: int
    blocks: int
    channels: int
    tail: str
    firing_s: float
    unit_m: float = 0.004

    def packet(self, at_s, mode=0x37, cells=b""):
        """Packet sent at a time of the day [s] by a head that looks ahead at the end of each turn."""
        returns = {0x39: 2, 0x3D: 3}.get(mode, 1)
        firings = self.blocks // returns
        body = b""
        for k in range(self.blocks):
            turned = (at_s - (firings - 1 - k // returns) * self.firing_s) / TURN_S
            body += bytes.fromhex(self.before) + struct.pack("<H", round(turned * 36_000) % 36_000)
            own = cells[self.cell * self.channels * (k % returns) :][: self.cell * self.channels]
            body += own or struct.pack("<HB", RANGE, 51).ljust(self.cell, b"\0") * self.channels
        second, micros = divmod(round(at_s * 1e6), 1_000_000)
        values = {
            "m": bytes([mode]),
            "d": bytes((125, 11, 30, second // 3600, second // 60 % 60, second % 60)),
            "u": struct.pack("<I", micros),
        }
        tail = b"".join(values.get(word) or bytes(int(word)) for word in self.tail.split())
        return bytes.fromhex(self.header) + body + tail

    def turns(self, n, **said):
        """Packets of so many turns."""
        firings = self.blocks // {0x39: 2, 0x3D: 3}.get(said.get("mode", 0), 1)
        step_s = firings * self.firing_s
        day_s = 36_000.0
        times_s = [day_s + step_s * k for k in range(int(n * TURN_S / step_s))]
        return [(BEGAN_S + at_s, self.packet(at_s, **said)) for at_s in times_s]


WRITTEN = {
    "Pandar40P": Written("", "ffee", 3, 10, 40, "5 1 2 2 u m 1 d", 55.56e-6),
    "Pandar64": Written("eeff400600040000", "", 3, 6, 64, "5 1 2 2 u m 1 d 4", 55.56e-6),
    "PandarQT64": Written("eeff03010000400401040201", "", 4, 4, 64, "10 2 u m 1 d 4", 166.67e-6),
    "PandarQT128": Written("eeff0302030080020104021d", "", 4, 2, 128, "4 17 12 m 2 d u 1 4 4 32", 111.11e-6),
    "PandarXT-16": Written("eeff06010000100801040201", "", 4, 8, 16, "10 m 2 d u 1 4", 50e-6),
    "PandarXT-32": Written("eeff06010000200801040201", "", 4, 8, 32, "10 m 2 d u 1 4", 50e-6),
    "PandarXT-32M": Written("eeff06010000200601050301", "", 4, 6, 32, "10 m 2 d u 1 4", 50e-6, 0.005),
}


def angles_of(channels):
    """Elevation and azimuth [deg]; the beams look to either side of the head."""
    return np.column_stack([np.linspace(20, -25, channels), 5.0 * (-1.0) ** np.arange(channels)])


@pytest.mark.parametrize("name", WRITTEN)
def test_each_model_is_decoded_by_its_angles(name):
    model = WRITTEN[name]
    angles_deg = angles_of(model.channels)
    decoder = HesaiDecoder("sensor", angles_deg)
    (sweep,), reception = decoded(decoder, model.turns(1.7))
    assert model_of(model.packet(0.0)).name == name
    assert_whole_turn(sweep, reception, TURN_S, BEGAN_S + 36_000 + TURN_S)
    x, y, z, _ = sweep.points.T
    distance = np.sqrt(x * x + y * y + z * z)
    assert distance == pytest.approx(RANGE * model.unit_m, rel=1e-4)
    assert len(x) == pytest.approx(TURN_S / model.firing_s * model.channels, rel=0.002)
    elevation = np.rad2deg(np.arcsin(z / distance))
    assert np.unique(elevation.round(2)) == pytest.approx(np.sort(angles_deg[:, 0]), abs=0.02)
    top = np.abs(elevation - angles_deg[0, 0]) < 0.01
    clockwise_rad(x[top], y[top])


@pytest.mark.parametrize(("mode", "seen"), [(0x37, 3.0), (0x39, 7.0), (0x3D, 7.0)])
def test_the_brightest_of_several_returns_is_taken(mode, seen):
    model = WRITTEN["PandarXT-32M"]
    cells = b"".join(struct.pack("<HBB", round(m / 0.005), r, 0) * 32 for m, r in ((3.0, 10), (7.0, 90), (9.0, 5)))
    (sweep,), reception = decoded(HesaiDecoder("sensor", angles_of(32)), model.turns(1.7, mode=mode, cells=cells))
    assert sweep.complete
    assert np.linalg.norm(sweep.points[:, :3], axis=1) == pytest.approx(seen, rel=1e-4)
    assert reception.lost == 0


@pytest.mark.parametrize(("angles_deg", "given"), [(None, "is not given"), (angles_of(32), "has 32 channels")])
def test_a_model_whose_units_differ_needs_its_calibration(tmp_path, angles_deg, given):
    timed = WRITTEN["Pandar64"].turns(1)
    decoder = HesaiDecoder("sensor", angles_deg)
    sweeps, reception = decoded(decoder, timed)
    reason = f"the calibration of this Pandar64 {given}; {REMEDY}"
    assert (sweeps, reception.refused) == ([], {reason: len(timed)})
    sweeps, _ = decoded(decoder, WRITTEN["PandarXT-32"].turns(3.7))  # forged packets at start blind nobody
    assert len(sweeps) == 3
    path = tmp_path / "forged.pcap"
    write_capture(path, timed, 2368)
    with pytest.raises(MisuseError, match=r"no whole sweep \(Hesai\), packets are refused: the calibration"):
        open_capture(path, {})


def test_a_table_without_plausible_angles_is_no_calibration(tmp_path):
    path = tmp_path / "angles.csv"
    for text in ("", "Channel,Elevation,Azimuth\n", "1,95.0,0\n", "1,nan,0\n"):
        path.write_text(text)
        with pytest.raises(MisuseError, match="no calibration of a Hesai"):
            read_angles(path)


TABLE = b"Laser id,Elevation,Azimuth\r\n1,15.5,-1.04\r\n2,14,3.1\r\n"


@pytest.mark.parametrize(
    ("answer", "angles"),
    [
        (b"\x47\x74\x05\x00" + struct.pack(">I", len(TABLE)) + TABLE, [[15.5, -1.04], [14, 3.1]]),
        (b"\x47\x74\x05\x01" + bytes(4), None),
        (b"\x47\x74\x05\x00\xff\xff\xff\xff", None),
        (b"\x47", None),
    ],
)
def test_the_sensor_is_asked_for_its_calibration(answer, angles, caplog):
    with socket.create_server(("127.0.0.1", 0)) as server:

        def give():
            asking, _ = server.accept()
            with asking:
                assert asking.recv(100) == GET_CALIBRATION == bytes.fromhex("4774050000000000")
                asking.sendall(answer)

        giving = threading.Thread(target=give)
        giving.start()
        angles_deg = asked_angles("127.0.0.1", server.getsockname()[1])
        giving.join()
    assert (None if angles_deg is None else angles_deg.tolist()) == angles
    assert ("does not give its calibration" in caplog.text) is (angles is None)
