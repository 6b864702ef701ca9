"""Velodyne's packets: sweeps cut behind the sensor, everything else counted."""

import logging
import re
import struct

import numpy as np
import pytest

from modt.sources.drivers.velodyne import VelodyneDecoder, model_named
from modt.sources.packets.pcap_file import PcapFile
from modt.sources.stream import OTHER_SENSOR
from tests.sources.packets.simulated import BEGAN_S, bearing_deg, decoded, equal, packets, scene
from tools.send.ideal_packets import LAYOUTS, ideal_calibration, packets_of
from tools.send.loops import VelodyneStamps


def sweeps_of(timed, **options):
    return decoded(VelodyneDecoder("sensor", **options), timed)


@pytest.mark.slow
def test_an_hdl_64e_is_recognised_and_warned_of_without_its_calibration(tmp_path, caplog):
    decoder = VelodyneDecoder("sensor")
    assert len(decoded(decoder, packets("hdl-64e", 4))[0]) == 2
    assert decoder.profile == "hdl-64e"
    assert "give its own by calibration=FILE" in caplog.text
    caplog.clear()
    (tmp_path / "ideal.yaml").write_text(ideal_calibration(LAYOUTS["hdl-64e"]))
    sweeps, _ = sweeps_of(packets("hdl-64e", 4), calibration=tmp_path / "ideal.yaml")
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


@pytest.mark.parametrize(("first", "lost"), [(160, 60), (160, 200)])
def test_a_burst_of_losses_is_counted_whole(first, lost):
    timed = packets(sweeps=8)
    sweeps, reception = sweeps_of(timed[:first] + timed[first + lost :])
    assert reception.lost == lost
    whole = [s.points.tobytes() for s in sweeps_of(timed)[0]]
    assert 3 <= len(sweeps) <= len(whole)
    assert all(s.points.tobytes() in whole for s in sweeps if s.complete)


def test_a_sector_that_the_sensor_is_set_not_to_see_is_not_lost_and_its_sweep_ends_at_the_pause():
    timed = [(at_s, p) for at_s, p in packets() if not 90 < azimuth_deg(p) < 270]
    whole, reception = sweeps_of(timed)
    assert [s.complete for s in whole] == [True] * len(whole)
    assert len(whole) >= 2
    assert reception.lost == 0
    assert np.abs(bearing_deg(whole[0].points)).max() < 100
    decoder = VelodyneDecoder("sensor")
    paused = []
    for i, (at_s, payload) in enumerate(timed):
        decoder.decode(at_s, payload)
        if i + 1 < len(timed) and timed[i + 1][0] - at_s > 0.01:
            paused.append(len(decoder.pause()))
            assert not decoder.pause()
    assert paused[:1] == [0]  # the sector is known after a turn
    assert paused.count(1) == len(whole) - 1
    assert decoder.reception.lost == 0


def restamped(payload, by_s):
    stamp_us = struct.unpack_from("<I", payload, 1200)[0] + by_s * 1e6
    return payload[:1200] + struct.pack("<I", round(stamp_us) % 3_600_000_000) + payload[1204:]


def azimuth_deg(payload):
    return struct.unpack_from("<H", payload, 2)[0] / 100


def with_tail(timed, tail):
    """Packets with a return mode and an identity."""
    return [(at_s, payload[:1204] + bytes(tail)) for at_s, payload in timed]


@pytest.mark.parametrize(
    ("identity", "declared", "warning"),
    [
        (0x22, None, None),
        (0x22, "vlp-16", None),
        (0x21, None, "hdl-32e.*decoded as vlp-16; give model="),
        (0x21, "vlp-16", "hdl-32e.*decoded as vlp-16; leave model= out"),
        (0x22, "vlp-32c", "vlp-16.*decoded as vlp-32c; leave model= out"),
    ],
)
def test_the_model_is_by_its_pace_or_as_declared_and_a_contradiction_is_one_line(identity, declared, warning, caplog):
    timed = with_tail(packets(), (0x37, identity))
    decoder = VelodyneDecoder("sensor", model_named(declared) if declared else None)
    with caplog.at_level(logging.WARNING):
        sweeps, _ = decoded(decoder, timed)
    assert decoder.profile == (declared or "vlp-16")
    assert len(caplog.records) == (warning is not None)
    assert warning is None or re.search(warning, caplog.text)
    assert all(np.isfinite(s.points).all() for s in sweeps)
    if declared != "vlp-32c":
        assert equal(sweeps, sweeps_of(packets())[0])


def test_single_returns_of_any_kind_are_taken_but_no_unknown_model():
    assert equal(sweeps_of(with_tail(packets(), (0x38, 0x22)))[0], sweeps_of(packets())[0])
    sweeps, reception = sweeps_of(with_tail(packets(), (0x37, 0x77)))
    assert sweeps == []
    assert reception.refused == {"of a model of Velodyne that is unknown; give model=": len(packets())}


@pytest.mark.parametrize("behind_s", [0.02, 0.05, 0.08])
def test_of_two_heads_on_one_port_one_is_followed_and_the_other_named(behind_s):
    """Both heads have the same clock; the second one is behind the first in its turn."""
    stamps = VelodyneStamps()

    def sent(by_s):
        timed = [(at_s + by_s, payload) for at_s, payload in packets()]
        return [(at_s, stamps.stamped(payload, round(1e6 * at_s) % stamps.wrap_us)) for at_s, payload in timed]

    alone, _ = sweeps_of(sent(0.0))
    both, reception = sweeps_of(sorted(sent(0.0) + sent(behind_s)))
    assert equal(both[: len(alone)], alone)
    assert len(both) <= len(alone) + 1, "the first head ends before the second one"
    assert list(reception.refused) == [OTHER_SENSOR]
    assert reception.refused[OTHER_SENSOR] > 0.8 * len(packets())


@pytest.mark.parametrize("turn_s", [0.05, 0.2])
def test_a_head_at_another_rate_loses_nothing(turn_s):
    timed = [(BEGAN_S + at_s, payload) for at_s, payload in packets_of(scene("vlp-16", 5), "vlp-16", turn_s)]
    sweeps, reception = sweeps_of(timed)
    assert len(sweeps) == 3
    assert all(sweep.complete for sweep in sweeps)
    assert [sweep.turn_s for sweep in sweeps] == pytest.approx([turn_s] * 3, abs=1e-3)
    assert (reception.lost, reception.refused) == (0, {})


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
    capture = PcapFile(kitti_root / "velodyne" / f"{name}.pcap")
    decoder = VelodyneDecoder(name)
    sweeps, reception = decoded(decoder, ((d.stamp_s, d.payload) for d in capture if len(d.payload) == 1206))
    assert decoder.profile == profile
    assert len(sweeps) == n_sweeps
    assert all(s.complete for s in sweeps)
    assert (reception.lost, reception.refused) == (0, {})
    assert [s.turn_s for s in sweeps] == pytest.approx([turn_s] * n_sweeps, abs=2e-4)
