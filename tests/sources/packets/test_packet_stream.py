"""Captures as streams."""

import numpy as np
import pytest

from modt.errors import MisuseError
from modt.sources.capture import open_capture
from modt.sources.recognise import open_stream
from tests.sources.packets.simulated import packets
from tools.send.pcap_writer import write_capture


@pytest.fixture
def path(tmp_path):
    file = tmp_path / "drive.pcap"
    write_capture(file, packets(), 2368)
    return file


def test_a_hesai_is_recognised_and_has_the_calibration_beside_its_capture(tmp_path, caplog):
    write_capture(tmp_path / "drive.pcap", packets("xt-32", 3), 2368)
    (tmp_path / "drive.csv").write_text("\n".join(f"{i + 1},{15 - 0.9 * i},0" for i in range(32)))
    stream = open_stream(tmp_path / "drive.pcap")
    assert (stream.info.layout, stream.info.profile, stream.info.period_s) == ("Hesai packets", "xt-32", 0.1)
    assert stream.info.elevations_deg == pytest.approx(15 - 0.9 * np.arange(32))
    assert len(list(stream)) == 2
    assert not caplog.records


def test_a_broken_end_is_a_fault_and_what_came_before_is_used(path, caplog):
    info = open_stream(path).info
    whole = list(open_stream(path))
    assert (info.name, info.layout, info.profile, info.period_s) == ("drive", "Velodyne packets", "vlp-16", 0.1)
    path.write_bytes(path.read_bytes()[:-50])
    stream = open_stream(path)
    assert [f.points.tobytes() for f in stream] == [f.points.tobytes() for f in whole]
    assert [(f.frame, f.skipped) for f in stream.faults.first] == [(3, False)]
    assert "frame 3: truncated within a record" in caplog.text


def records_of(path):
    """The head of a capture, and its records."""
    raw = path.read_bytes()
    records = []
    at = 24
    while at < len(raw):
        size = 16 + int.from_bytes(raw[at + 8 : at + 12], "little")
        records.append(raw[at : at + size])
        at += size
    return raw[:24], records


def test_a_capture_whose_packets_were_cut_short_is_refused_for_that(path):
    head, records = records_of(path)
    cut = (record[:8] + (96).to_bytes(4, "little") + record[12 : 16 + 96] for record in records)
    path.write_bytes(head + b"".join(cut))
    with pytest.raises(MisuseError, match=r"the ends of \d+ UDP datagrams were not captured.*tcpdump -s 0"):
        open_stream(path)


def test_suffixes_may_have_capitals(path):
    renamed = path.rename(path.with_name("DRIVE.PCAP"))
    assert len(list(open_stream(renamed))) == 3


def test_missing_and_refused_packets_are_faults_and_a_clock_that_is_set_is_none(path):
    timed = [*packets()]
    del timed[110:113]
    timed.insert(50, (timed[50][0], bytes(1206)))
    write_capture(path, timed, 2368)
    stream = open_stream(path)
    assert [f.index for f in stream] == [0, 1, 2]
    assert [(f.frame, f.cause, f.skipped) for f in stream.faults.first] == [
        (0, "3 packets are missing", False),
        (3, "1 packets refused: no packet of a Velodyne", False),
    ]
    timed = [*packets(), *((at_s - 59.4, payload) for at_s, payload in packets(sweeps=8))]
    write_capture(path, timed, 2368)
    stream = open_stream(path)
    stamps_s = [f.stamp_s for f in stream]
    assert stamps_s == sorted(stamps_s)
    assert len(stamps_s) >= 8
    assert stream.faults.skipped == 0
    assert stream.faults.first[-1].cause == "1 packets refused: its stamp leaps: the clock was set, or lies"


@pytest.mark.parametrize(
    ("timed", "cause"),
    [
        ([], "no packets of a Hesai or Livox or Ouster or RoboSense or Velodyne"),
        ([(0.0, b"x")], "give metadata=FILE"),
        (packets()[:50], "no whole sweep"),
    ],
    ids=["empty", "others", "short"],
)
def test_a_capture_without_a_sweep_is_refused(tmp_path, timed, cause):
    path = tmp_path / "a.pcap"
    write_capture(path, timed, 2368)
    with pytest.raises(MisuseError, match=cause):
        open_capture(path, {})


@pytest.mark.kitti
def test_an_ouster_is_recognised_by_the_metadata_beside_its_capture(kitti_root):
    pytest.importorskip("ouster.sdk.core", reason="needs the extra [ouster]")
    folder = kitti_root / "ouster"
    stream = open_stream(folder / "OS-1-32-G_v2.1.1_1024x10.pcap")
    assert (stream.info.layout, stream.info.profile, len(list(stream))) == ("Ouster packets", "os1-32", 1)
    assert len(stream.info.elevations_deg) == 32
    named = {"metadata": str(folder / "OS-1-128_v2.3.0_1024x10.json")}
    assert len(list(open_stream(folder / "OS-1-128_v2.3.0_1024x10_lb_n3.pcap", capture=named))) == 3


def of_two(path):
    """The packets of a sensor, and those of another one from the half on."""
    head, records = records_of(path)
    mixed = []
    for k, record in enumerate(records):
        mixed.append(record)
        if k >= len(records) // 2:
            other = bytearray(record)
            other[16 + 14 + 12 : 16 + 14 + 16] = bytes([192, 0, 2, 9])
            mixed.append(bytes(other))
    path.write_bytes(head + b"".join(mixed))


def test_one_of_several_sensors_in_a_capture_is_chosen_and_the_others_are_named(path):
    alone = len(list(open_stream(path)))
    of_two(path)
    stream = open_stream(path)
    assert len(list(stream)) == alone
    assert any("--capture host=192.0.2.9" in note for note in stream.info.notes)
    other = open_stream(path, capture={"host": "192.0.2.9"})
    assert 0 < len(list(other)) < alone
    with pytest.raises(MisuseError, match=r"no packets of host=192\.0\.2\.7"):
        open_stream(path, capture={"host": "192.0.2.7"})


def test_packets_of_a_sensor_that_is_not_decoded_are_named(tmp_path):
    msop = bytes.fromhex("55aa5aa5") + bytes(1206)
    write_capture(tmp_path / "a.pcap", [(1.0, msop)] * 5, 6699)
    with pytest.raises(MisuseError, match=r"packets of a RoboSense M or E.*ros2://"):
        open_stream(tmp_path / "a.pcap")
