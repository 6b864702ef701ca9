"""Velodyne's packets: sweeps cut behind the sensor, everything else counted."""

import logging
import struct

import numpy as np
import pytest
from scipy.spatial import cKDTree

from modt.errors import MisuseError
from modt.sources.packets.capture import Capture
from modt.sources.packets.velodyne import VelodyneDecoder, model_named
from modt.sources.stream import Reception
from tests.sources.packets.simulated import BEGAN_S, bearing_deg, decoded, equal, packets
from tools.send.ideal_packets import LAYOUTS, ideal_calibration

pytest.importorskip("velodyne_decoder", reason="needs the extra [velodyne]")


def sweeps_of(timed, **options):
    return decoded(VelodyneDecoder("sensor", **options), timed)


@pytest.fixture
def calibration(tmp_path):
    path = tmp_path / "ideal.yaml"
    path.write_text(ideal_calibration(LAYOUTS["hdl-64e"]))
    return path


def test_sweeps_of_a_vlp_16():
    timed = packets()
    sweeps, reception = sweeps_of(timed)
    assert len(sweeps) == 3  # the first turn began before it was heard
    assert all(s.complete for s in sweeps)
    assert (reception.lost, reception.refused) == (0, {})
    for k, sweep in enumerate(sweeps, 1):
        assert sweep.turn_s == pytest.approx(0.1, abs=1e-4)
        assert sweep.stamp_s == pytest.approx(BEGAN_S + 0.1 * k + 0.05, abs=1e-3)  # straight ahead
        assert sweep.points.dtype == np.float32
        assert 0 < sweep.points[:, 3].max() <= 1
        assert 20_000 < len(sweep.points) < 30_000


def test_points_are_those_of_the_scene_in_the_frame_of_the_sensor():
    from modt_desk.simulation.synthetic_stream import SyntheticStream

    scene = list(SyntheticStream("street", "vlp-16", 0.5, seed=1))
    for sweep, frame in zip(sweeps_of(packets())[0], scene[1:4], strict=True):
        distance, _ = cKDTree(frame.points[:, :3]).query(sweep.points[:, :3])
        assert np.quantile(distance, 0.95) < 0.05  # m; a packet's azimuths are those of its blocks


@pytest.mark.slow
def test_an_hdl_64e_is_recognised_and_warned_of_without_its_calibration(calibration, caplog):
    decoder = VelodyneDecoder("sensor")
    assert len(decoded(decoder, packets("hdl-64e", 4))[0]) == 2
    assert decoder.profile == "hdl-64e"
    assert "give its own by calibration=FILE" in caplog.text
    caplog.clear()
    sweeps, _ = sweeps_of(packets("hdl-64e", 4), calibration=calibration)
    assert [s.complete for s in sweeps] == [True, True]
    elevation = np.rad2deg(np.arcsin(sweeps[0].points[:, 2] / np.linalg.norm(sweeps[0].points[:, :3], axis=1)))
    off = np.abs(elevation[:, None] - LAYOUTS["hdl-64e"].elevations_deg).min(axis=1)
    assert off.max() < 0.01
    assert not caplog.records


@pytest.mark.parametrize(
    ("heard", "gap_s", "stamped_s", "steps_s"), [(200, 5.0, 5.0, [5.0]), (None, 9.0, 0.0, [0.1, 0.1, 8.8])]
)
def test_after_a_silence_or_a_restart_sweeps_begin_at_the_next_seam(heard, gap_s, stamped_s, steps_s):
    timed = packets()
    later = [(at_s + gap_s, restamped(payload, stamped_s)) for at_s, payload in timed]
    sweeps, reception = sweeps_of([*timed[:heard], *later])
    assert all(s.complete for s in sweeps)
    assert reception.lost == 0
    assert np.diff([s.stamp_s for s in sweeps]) == pytest.approx([*steps_s, 0.1, 0.1], abs=2e-3)


@pytest.mark.parametrize(("first", "lost"), [(160, 60), (160, 140), (160, 200)])
def test_a_burst_of_losses_is_counted_whole(first, lost):
    timed = packets(sweeps=8)
    sweeps, reception = sweeps_of(timed[:first] + timed[first + lost :])
    assert reception.lost == lost
    whole = [s.points.tobytes() for s in sweeps_of(timed)[0]]
    assert 3 <= len(sweeps) <= len(whole)
    assert all(s.points.tobytes() in whole for s in sweeps if s.complete)


def test_a_head_that_stands_still_gives_no_sweep_and_what_is_kept_is_bounded():
    payload = packets()[100][1]
    decoder, reception = VelodyneDecoder("sensor"), Reception()
    for k in range(2000):
        still = payload[:2] + struct.pack("<H", 9000 + k % 3) + payload[4:]
        assert not decoder.decode(BEGAN_S + 1e-3 * k, restamped(still, 1e-3 * k), reception)
    assert len(decoder._turn.entries) < 400


def test_a_sector_that_the_sensor_is_set_not_to_see_is_not_lost():
    timed = [(at_s, p) for at_s, p in packets() if not 90 < azimuth_deg(p) < 270]
    sweeps, reception = sweeps_of(timed)
    assert [s.complete for s in sweeps] == [True] * len(sweeps)
    assert len(sweeps) >= 2
    assert reception.lost == 0
    assert np.abs(bearing_deg(sweeps[0].points)).max() < 100


def test_a_sweep_of_a_sector_is_handed_over_when_its_sensor_pauses():
    timed = [(at_s, p) for at_s, p in packets() if not 90 < azimuth_deg(p) < 270]
    whole, _ = sweeps_of(timed)
    decoder, reception = VelodyneDecoder("sensor"), Reception()
    sweeps, paused = [], []
    for i, (at_s, payload) in enumerate(timed):
        sweeps += decoder.decode(at_s, payload, reception)
        if i + 1 < len(timed) and timed[i + 1][0] - at_s > 0.01:
            paused.append(len(decoder.pause(reception)))
            sweeps += decoder.pause(reception)  # once only
    assert paused[:1] == [0]  # the sector is known after a turn
    assert paused.count(1) == len(whole) - 1
    assert reception.lost == 0


def restamped(payload, by_s):
    stamp_us = struct.unpack_from("<I", payload, 1200)[0] + round(by_s * 1e6)
    return payload[:1200] + struct.pack("<I", stamp_us % 3_600_000_000) + payload[1204:]


def azimuth_deg(payload):
    return struct.unpack_from("<H", payload, 2)[0] / 100


def with_identity(timed, identity):
    return [(at_s, payload[:1205] + bytes([identity])) for at_s, payload in timed]


@pytest.mark.parametrize(
    ("identity", "declared", "warning"),
    [
        (0x22, None, None),
        (0x22, "vlp-16", None),
        (0x21, None, "say hdl-32e at the pace of vlp-16; decoded as vlp-16; give model= to overrule"),
        (
            0x21,
            "vlp-16",
            "say hdl-32e at the pace of vlp-16; decoded as vlp-16; leave model= out to have it recognised",
        ),
        (0x22, "vlp-32c", "say vlp-16; decoded as vlp-32c; leave model= out to have it recognised"),
    ],
)
def test_the_model_is_by_its_pace_or_as_declared_and_a_contradiction_is_one_line(identity, declared, warning, caplog):
    timed = with_identity(packets(), identity)
    decoder = VelodyneDecoder("sensor", model_named(declared) if declared else None)
    with caplog.at_level(logging.WARNING):
        sweeps, _ = decoded(decoder, timed)
    assert decoder.profile == (declared or "vlp-16")
    assert [r.message for r in caplog.records] == ([f"sensor: its packets {warning}"] if warning else [])
    if declared != "vlp-32c":
        assert equal(sweeps, sweeps_of(packets())[0])


@pytest.mark.parametrize("declared", ["vlp-16", "hdl-64e", "vls-128", "vlp-32c"])
@pytest.mark.parametrize("sent", ["vlp-16", "hdl-64e"])
def test_a_wrong_declaration_breaks_nothing(sent, declared):
    sweeps, _ = sweeps_of(packets(sent, 5 if sent == "vlp-16" else 4), model=model_named(declared))
    assert all(np.isfinite(s.points).all() for s in sweeps)


def test_single_returns_of_any_kind_are_taken():
    single, _ = sweeps_of(packets())
    last = [(at_s, payload[:1204] + b"\x38" + payload[1205:]) for at_s, payload in packets()]
    assert equal(sweeps_of(last)[0], single)


def test_an_unknown_model_is_counted():
    timed = with_identity(packets(), 0x77)
    sweeps, reception = sweeps_of(timed)
    assert sweeps == []
    assert reception.refused == {"of a model of Velodyne that is unknown; give model=": len(timed)}


def test_an_unknown_name_and_a_broken_calibration_are_refused(tmp_path):
    with pytest.raises(MisuseError, match="use one of vlp-16"):
        model_named("vlp-17")
    broken = tmp_path / "broken.yaml"
    broken.write_text("lasers: 5")
    with pytest.raises(MisuseError, match="no calibration"):
        VelodyneDecoder("sensor", None, broken)


@pytest.mark.kitti
@pytest.mark.parametrize(
    ("name", "profile", "n_sweeps", "turn_s"),
    [
        ("sample_velodyne_vlp16_gps", "vlp-16", 3, 0.1001),
        ("sample_velodyne_hdl32", "hdl-32e", 1, 0.1106),
        ("monterey-first-100-packets", "hdl-32e", 17, 0.0849),
        ("vlp-16-test-90deg-1-50-frames", "vlp-16", 49, 0.0500),
    ],
)
def test_real_captures(kitti_root, name, profile, n_sweeps, turn_s):
    capture = Capture(kitti_root / "velodyne" / f"{name}.pcap")
    decoder = VelodyneDecoder(name)
    sweeps, reception = decoded(decoder, ((d.stamp_s, d.payload) for d in capture if len(d.payload) == 1206))
    assert decoder.profile == profile
    assert len(sweeps) == n_sweeps
    assert all(s.complete for s in sweeps)
    assert (reception.lost, reception.refused) == (0, {})
    assert [s.turn_s for s in sweeps] == pytest.approx([turn_s] * n_sweeps, abs=2e-4)


@pytest.mark.slow
def test_another_model_is_adopted_once_the_one_before_is_silent(caplog):
    other = packets("hdl-64e", 2)[:20]
    later = [(at_s + 5.0, payload) for at_s, payload in packets("vlp-16", 20)]
    decoder = VelodyneDecoder("sensor")
    sweeps, reception = decoded(decoder, [*other, *later])
    assert decoder.profile == "vlp-16"
    assert len(sweeps) >= 17
    assert reception.refused["of another model than the packets before"] == 20
    assert "packets are of another model, and those of the one before have ended" in caplog.text


def at_time(payload, time_us):
    return payload[:1200] + struct.pack("<I", int(time_us)) + payload[1204:]


def test_a_turn_holds_no_more_packets_than_a_sensor_sends():
    timed = packets("vlp-16", 5)
    decoder, reception = VelodyneDecoder("sensor"), Reception()
    for at_s, payload in timed[:130]:
        decoder.decode(at_s, payload, reception)
    began_us, last_us = (struct.unpack_from("<I", timed[k][1], 1200)[0] for k in (80, 129))
    for k in range(3000):
        within_us = began_us + (last_us - began_us) * (0.1 + 0.8 * (k * 0.618 % 1))
        decoder.decode(timed[129][0], at_time(timed[100][1], within_us), reception)
    assert len(decoder._turn.entries) <= decoder._most < 500
    assert reception.refused["more than a turn has; do several sensors send to this port?"] > 2000
    sweeps = [s for at_s, p in timed[130:] for s in decoder.decode(at_s, p, reception)]
    assert len(sweeps) >= 2  # the sensor's own packets go on


def test_lost_packets_are_never_negative():
    decoder, reception = VelodyneDecoder("sensor"), Reception()
    lost = 0
    for k, (at_s, payload) in enumerate(packets("vlp-16", 8)):
        stamp_us = struct.unpack_from("<I", payload, 1200)[0]
        if k % 200 == 199:  # ever so slightly after the last, in a turn that has lasted for too long
            decoder._longest_s = 0.0
            stamp_us -= 1300
        decoder.decode(at_s, at_time(payload, stamp_us), reception)
        assert reception.lost >= lost
        lost = reception.lost
