"""The sender of packets, and faults of a network."""

import sys
from types import SimpleNamespace

import numpy as np
import pytest

from modt.errors import MisuseError
from modt.sources.capture import open_capture
from modt.sources.packets.pcap_file import PcapFile
from modt.sources.recognise import open_stream
from tests.sources import layouts
from tests.sources.packets.simulated import packets
from tools.send import packets as sender
from tools.send.faults import PacketFaults
from tools.send.loops import ouster_loop, turn_loop
from tools.send.pcap_writer import write_capture


def test_each_packet_is_sent_when_it_is_due():
    now_s = [10.0]
    slept = []
    sent = []

    def sleep(time_s):
        slept.append(time_s)
        now_s[0] += time_s

    timed = [(0.0, b"a"), (0.5, b"b"), (0.5, b"c"), (2.0, b"d")]
    to = SimpleNamespace(send=sent.append)
    assert sender.send(timed, to, clock=lambda: now_s[0], sleep=sleep) == 4
    assert sent == [b"a", b"b", b"c", b"d"]
    assert slept == pytest.approx([0.5, 1.5])


def test_a_loop_needs_a_whole_turn():
    with pytest.raises(MisuseError, match="no whole turn"):
        next(turn_loop([p for _, p in packets()][:60]))


def written(tmp_path, monkeypatch, *arguments):
    out = tmp_path / "out.pcap"
    monkeypatch.setattr(sys, "argv", ["packets", "127.0.0.1:2368", *map(str, arguments), "--write", str(out)])
    sender.main()
    return out


def test_a_capture_is_repeated_without_a_gap_or_sent_as_it_is(tmp_path, monkeypatch):
    pytest.importorskip("velodyne_decoder", reason="needs the extra [velodyne]")
    path = tmp_path / "in.pcap"
    write_capture(path, packets(), 2368)
    stream = open_capture(written(tmp_path, monkeypatch, path, "--seconds", "1"), {})
    stamps_s = [f.stamp_s for f in stream]
    assert len(stamps_s) == 9
    assert np.diff(stamps_s) == pytest.approx([0.1] * 8, abs=1e-3)
    assert stream.faults.count == 0
    once = PcapFile(written(tmp_path, monkeypatch, path, "--once"))
    assert [d.payload for d in once] == [p for _, p in packets()]


def test_a_stream_of_scans_is_sent_as_an_hdl_64e(tmp_path, monkeypatch):
    pytest.importorskip("velodyne_decoder", reason="needs the extra [velodyne]")
    scans = layouts.bare(tmp_path)
    calibration = tmp_path / "ideal.yaml"
    out = written(tmp_path, monkeypatch, scans, "--as", "hdl-64e", "--calibration", calibration, "--seconds", "0.35")
    stream = open_stream(out, capture={"calibration": str(calibration)})
    assert stream.info.profile == "hdl-64e"
    assert len(list(stream)) == 2


@pytest.mark.kitti
def test_an_ouster_is_repeated_without_a_gap(kitti_root, tmp_path):
    pytest.importorskip("ouster.sdk.core", reason="needs the extra [ouster]")
    metadata = kitti_root / "ouster" / "OS-1-32-G_v2.1.1_1024x10.json"
    payloads = [d.payload for d in PcapFile(metadata.with_suffix(".pcap"))]
    path = tmp_path / "loop.pcap"
    write_capture(path, (timed for timed, _ in zip(ouster_loop(payloads, metadata), range(256), strict=False)), 7502)
    stream = open_capture(path, {"metadata": str(metadata)})
    frames = list(stream)
    assert stream.reception.lost == 0
    assert np.diff([f.stamp_s for f in frames]) == pytest.approx([0.1] * 3, abs=1e-3)
    assert len({f.points.tobytes() for f in frames}) == 1


PACKETS = [(0.1 * k, bytes([k])) for k in range(200)]


def applied(**shares):
    return list(PacketFaults(**shares).applied(PACKETS))


def test_a_seed_decides_on_the_faults_and_without_shares_there_are_none():
    assert applied() == PACKETS
    shares = {"lost": 0.1, "duplicated": 0.1, "reordered": 0.1, "garbage": 0.1}
    assert applied(**shares, seed=1) == applied(**shares, seed=1) != applied(**shares, seed=2)


def test_each_fault_is_of_its_kind():
    payloads = [p for _, p in PACKETS]
    lost = [p for _, p in applied(lost=0.2)]
    assert 120 < len(lost) < 190
    assert lost == [p for p in payloads if p in set(lost)]
    doubled = [p for _, p in applied(duplicated=0.2)]
    assert sorted(set(doubled)) == payloads
    assert len(doubled) > 210
    disordered = [p for _, p in applied(reordered=0.2)]
    assert disordered != payloads
    assert sorted(disordered) == payloads[: len(disordered)]
    assert len([p for _, p in applied(garbage=0.2)]) > 210
