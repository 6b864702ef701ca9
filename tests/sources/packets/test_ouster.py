"""Ouster's packets: the SDK's frames, everything else counted."""

import threading
from functools import partial
from http.server import HTTPServer, SimpleHTTPRequestHandler

import numpy as np
import pytest

from modt.errors import MisuseError
from modt.schemes import open_sensor
from modt.sources.drivers import ouster
from modt.sources.drivers.ouster import RESTARTED_BY, OusterDecoder
from modt.sources.packets.pcap_file import PcapFile
from tests.sources.packets.simulated import bearing_deg, decoded, equal

sdk = pytest.importorskip("ouster.sdk.core", reason="needs the extra [ouster]")
pytestmark = pytest.mark.kitti


@pytest.fixture
def metadata(kitti_root):
    return kitti_root / "ouster" / "OS-1-128_v2.3.0_1024x10.json"


@pytest.fixture
def timed(kitti_root):
    """Three sweeps of 64 packets."""
    datagrams = PcapFile(kitti_root / "ouster" / "OS-1-128_v2.3.0_1024x10_lb_n3.pcap")
    return [(d.stamp_s, d.payload) for d in datagrams if d.port == 7502]


def test_sweeps_are_the_frames_of_the_sdk(timed, metadata):
    decoder = OusterDecoder("sensor", metadata)
    sweeps, reception = decoded(decoder, timed)
    assert (decoder.profile, decoder.period_s, len(decoder.elevations_deg)) == ("os1-128", 0.1, 128)
    assert decoder.elevations_deg[0] > 20 > -20 > decoder.elevations_deg[-1]
    assert (reception.lost, reception.refused) == (0, {})
    assert [s.complete for s in sweeps] == [True] * 3
    assert np.diff([s.stamp_s for s in sweeps]) == pytest.approx([0.1, 0.1], abs=1e-3)
    assert [s.turn_s for s in sweeps] == pytest.approx([0.1] * 3, abs=1e-3)
    info = sdk.SensorInfo(metadata.read_text())
    batcher = sdk.FrameBatcher(info)
    frame = sdk.LidarFrame(info)
    project = sdk.XYZLut(info)
    for _, payload in timed[:64]:
        packet = sdk.LidarPacket(sdk.PacketFormat(info))
        packet.buf[:] = np.frombuffer(payload, np.uint8)
        packet.host_timestamp = 1
        batcher.batch(packet, frame)
    seen = frame.field("RANGE") > 0
    np.testing.assert_allclose(sweeps[0].points[:, :3], project(frame)[seen], atol=1e-4)
    np.testing.assert_allclose(sweeps[0].points[:, 3] * 255, frame.field("REFLECTIVITY")[seen], atol=1e-3)
    header = sdk.PacketFormat(info).packet_header
    heads = [np.frombuffer(p, np.uint8) for _, p in timed[:64]]
    columns_ns = np.concatenate([header(sdk.ColHeader.TIMESTAMP, head) for head in heads])
    ahead_s = float(columns_ns[512] - columns_ns[0]) * 1e-9  # the middle one looks straight ahead
    assert sweeps[0].stamp_s - timed[0][0] == pytest.approx(ahead_s, abs=2e-3)
    beam = sweeps[0].points[:600]  # rows of the image are beams: along one the head turns from behind to the right
    assert np.all(np.diff(np.unwrap(np.deg2rad(bearing_deg(beam)))) < 0.01)


def edited(timed, metadata, edit):
    """The packets after a call of `edit` with their format, the packet and its number."""
    layout = sdk.PacketFormat(sdk.SensorInfo(metadata.read_text()))
    out = []
    for k, (at_s, payload) in enumerate(timed):
        packet = sdk.LidarPacket(layout)
        packet.buf[:] = np.frombuffer(payload, np.uint8)
        edit(layout, packet, k)
        out.append((at_s, packet.buf.tobytes()))
    return out


@pytest.mark.parametrize("lies", [1, 64 * 3])
def test_frame_numbers_that_leap_ahead_or_begin_anew_cost_one_frame(timed, metadata, lies):
    """They are of a forged packet, or of the sensor before it is restarted."""
    ahead, anew = (
        edited(timed, metadata, lambda layout, packet, k, first=first: layout.set_frame_id(packet, first + k // 64))
        for first in (500, 0)
    )
    sweeps, reception = decoded(OusterDecoder("sensor", metadata), [*ahead[:lies], *anew])
    assert reception.refused == {"late: its frame has ended": RESTARTED_BY}
    assert len(sweeps) == lies // 64 + 2
    assert all(s.complete for s in sweeps)


def test_a_frame_without_stamps_is_refused(timed, metadata):
    def unstamp(layout, packet, _):
        for column in range(16):
            layout.set_col_timestamp(packet, column, 0)

    sweeps, reception = decoded(OusterDecoder("sensor", metadata), edited(timed, metadata, unstamp))
    assert (sweeps, sum(reception.refused.values())) == ([], 3)


def test_a_sweep_that_had_begun_is_dropped_and_a_lost_one_is_counted(timed, metadata):
    sweeps, reception = decoded(OusterDecoder("sensor", metadata), timed[10:])
    assert ([s.complete for s in sweeps], reception.lost) == ([True, True], 0)
    sweeps, reception = decoded(OusterDecoder("sensor", metadata), timed[:64] + timed[128:])
    assert (len(sweeps), reception.lost) == (2, 64)


@pytest.mark.parametrize(
    ("name", "beams", "turn_s", "profile"),
    [
        ("OS-0-32-U1_v2.2.0_1024x10", 32, 0.1, None),
        ("OS-0-128-U1_v2.3.0_1024x10", 128, 0.1, None),
        ("OS-1-32-G_v2.1.1_1024x10", 32, 0.1, "os1-32"),
        ("OS-2-32-U0_v2.0.0_1024x10", 32, 0.05, None),
        ("OS-2-128-U1_v2.3.0_1024x10", 128, 0.1, None),
    ],
)
def test_each_packet_format(kitti_root, name, beams, turn_s, profile):
    path = kitti_root / "ouster" / f"{name}.pcap"
    decoder = OusterDecoder(name, path.with_suffix(".json"))
    (sweep,), _ = decoded(decoder, ((d.stamp_s, d.payload) for d in PcapFile(path)))
    assert sweep.complete
    assert sweep.turn_s == pytest.approx(turn_s, rel=0.01)
    assert (len(decoder.elevations_deg), decoder.profile) == (beams, profile)
    assert np.isfinite(sweep.points).all()
    assert 0 <= sweep.points[:, 3].min() <= sweep.points[:, 3].max() <= 1


@pytest.mark.parametrize("text", ["{}", "no JSON"])
def test_invalid_metadata_are_refused(tmp_path, text):
    path = tmp_path / "metadata.json"
    path.write_text(text)
    with pytest.raises(MisuseError, match=r"no metadata of an Ouster.*api/v1/sensor/metadata"):
        OusterDecoder("sensor", path)
    with pytest.raises(MisuseError, match="cannot be read"):
        OusterDecoder("sensor", tmp_path / "nowhere.json")


@pytest.mark.parametrize(("kind", "cause"), [("sensor", ""), ("other", "HTTP Error 404"), ("off", "refused")])
def test_a_sensor_is_asked_for_its_metadata(kind, cause, metadata, tmp_path, monkeypatch):
    monkeypatch.setenv("http_proxy", "http://192.0.2.1:1")  # a sensor is never behind one
    if kind == "sensor":
        (tmp_path / "api/v1/sensor").mkdir(parents=True)
        (tmp_path / "api/v1/sensor/metadata").write_text(metadata.read_text())
    with HTTPServer(("127.0.0.1", 0), partial(SimpleHTTPRequestHandler, directory=str(tmp_path))) as server:
        monkeypatch.setattr(ouster, "METADATA", ouster.METADATA.replace("{host}", f"{{host}}:{server.server_port}"))
        if kind == "off":
            server.server_close()
        else:
            threading.Thread(target=server.handle_request, daemon=True).start()
        if cause:
            with pytest.raises(MisuseError, match=rf"{cause}.*check the sensor's address.*metadata=FILE"):
                open_sensor("ouster://127.0.0.1:0")
        else:
            live = open_sensor("ouster://127.0.0.1:0")
            assert (live.info.profile, len(live.info.elevations_deg)) == ("os1-128", 128)
            live.close()


def test_a_sensor_that_was_switched_on_again_is_still_the_one_of_the_metadata(timed, metadata):
    whole, _ = decoded(OusterDecoder("sensor", metadata), timed)
    again = [(at_s, p[:4] + b"\x01\x02\x03" + p[7:]) for at_s, p in timed]  # the number of its initialisation
    sweeps, reception = decoded(OusterDecoder("sensor", metadata), again)
    assert equal(sweeps, whole)
    assert reception.refused == {}
    decoder = OusterDecoder("sensor", metadata)
    sweeps = [s for at_s, payload in [*timed[:128], *again[128:]] for s in decoder.decode(at_s, payload)]
    assert [len(s.points) for s in sweeps] == [len(s.points) for s in whole]
