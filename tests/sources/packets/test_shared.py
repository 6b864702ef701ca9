"""Promises that the decoders of all makers share: faults of the network are counted and change no other sweep."""

import sys
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pytest
from scipy.spatial import cKDTree

from modt.errors import MisuseError
from modt.sources.drivers.hesai import HesaiDecoder, read_angles
from modt.sources.drivers.livox import LivoxDecoder
from modt.sources.drivers.ouster import OusterDecoder
from modt.sources.drivers.robosense import RobosenseDecoder
from modt.sources.drivers.velodyne import VelodyneDecoder
from modt.sources.packets.packet_decoder import PacketDecoder
from modt.sources.packets.pcap_file import PcapFile
from modt.sources.point_cloud_file import read_pcd
from tests.sequences import makers
from tests.sources.packets.robosense_packets import WRITTEN
from tests.sources.packets.simulated import BEGAN_S, decoded, equal, packets, scene
from tools.send.faults import Timed
from tools.send.packet_bag import packets_of_bag

OTHER = "of another model than the packets before"


def edited(at, value):
    """Function that overwrites bytes of a payload."""
    return lambda payload: payload[:at] + value + payload[at + len(value) :]


@dataclass(frozen=True)
class Maker:
    """A decoder, packets of three whole sweeps or more, and unusable packets with the reasons of their refusal."""

    decoder: Callable[[], PacketDecoder]
    timed: Callable[[], list[Timed]]
    lost: tuple[int, ...]  # packets within the second sweep
    broken: Callable[[bytes], bytes]  # a packet with an impossible field
    foreign: Callable[[bytes], bytes] | None  # a packet of another sensor
    refused: dict[str, int]  # reasons for three payloads of other lengths, a broken and a foreign one


def of_ouster():
    capture = PcapFile(makers.OUSTER_METADATA.with_name(f"{makers.OUSTER}_lb_n3.pcap"))
    return [(d.stamp_s, d.payload) for d in capture if d.port == 7502]


MAKERS = {
    "velodyne": Maker(
        lambda: VelodyneDecoder("sensor"),
        lambda: list(packets()),
        (160, 161, 190),
        edited(502, b"\xff\xff"),
        lambda _: packets("hdl-64e", 4)[40][1],
        {"no packet of a Velodyne": 4, OTHER: 1},
    ),
    "hesai": Maker(
        lambda: HesaiDecoder("sensor"),
        lambda: list(packets("xt-32", 4)),
        (400, 401, 430),
        edited(12, b"\xff\xff"),
        makers.xt_16,
        {"no packet of a Hesai": 4, OTHER: 1},
    ),
    "livox": Maker(
        lambda: LivoxDecoder("sensor"),
        lambda: list(packets("mid-360", 4)),
        (130, 131, 150),
        edited(10, b"\0"),
        None,
        {"no packet of points of a Livox": 4},
    ),
    "robosense": Maker(
        lambda: RobosenseDecoder("sensor"),
        lambda: WRITTEN["rs-16"].turns(4.7),
        (120, 121, 140),
        edited(44, b"\xff\xff"),
        lambda _: WRITTEN["bpearl"].packet(1.0),
        {"no packet of a RoboSense": 4, OTHER: 1},
    ),
    "ouster": Maker(
        lambda: OusterDecoder("sensor", makers.OUSTER_METADATA),
        of_ouster,
        (70, 71, 90),
        lambda p: np.random.default_rng(0).bytes(len(p)),
        edited(4, b"\x01" * 8),
        {
            "not the 8448 bytes of the metadata's format": 3,
            "no packet of an Ouster": 1,
            "of another sensor than the metadata": 1,
        },
    ),
}


@pytest.fixture(params=[pytest.param(name, marks=[pytest.mark.kitti] * (name == "ouster")) for name in MAKERS])
def maker(request):
    if request.param == "ouster":
        request.getfixturevalue("kitti_root")
        pytest.importorskip("ouster.sdk.core", reason="needs the extra [ouster]")
    return MAKERS[request.param]


@pytest.mark.parametrize(
    ("name", "model", "n", "whole", "turn_s"),
    [("velodyne", "vlp-16", 5, 3, 0.1), ("hesai", "xt-32", 4, 3, 0.1), ("livox", "mid-360", 4, 2, 0.0)],
)
def test_sweeps_are_those_of_the_scene(name, model, n, whole, turn_s):
    """The first turn began before it was heard."""
    decoder = MAKERS[name].decoder()
    sweeps, reception = decoded(decoder, packets(model, n))
    assert decoder.profile == model
    assert (len(sweeps), reception.lost, reception.refused) == (whole, 0, {})
    for k, (sweep, frame) in enumerate(zip(sweeps, scene(model, n)[1:], strict=False), 1):
        assert sweep.complete
        assert sweep.turn_s == pytest.approx(turn_s, abs=1e-4)
        assert sweep.stamp_s == pytest.approx(BEGAN_S + 0.1 * k + 0.05, abs=2e-3)  # straight ahead
        assert sweep.points.dtype == np.float32
        assert 0 < sweep.points[:, 3].max() <= 1
        returns = frame.points[frame.points[:, :3].any(axis=1)]
        assert len(sweep.points) == pytest.approx(len(returns), rel=0.02)
        distance, _ = cKDTree(returns[:, :3]).query(sweep.points[:, :3])
        assert np.quantile(distance, 0.95) < 0.05  # m; a packet's azimuths are those of its blocks


def test_a_missing_extra_is_named(monkeypatch):
    for module, name in (("velodyne_decoder", "velodyne"), ("ouster.sdk.core", "ouster")):
        monkeypatch.setitem(sys.modules, module, None)
        with pytest.raises(MisuseError, match=rf"pip install '\.\[{name}\]'"):
            MAKERS[name].decoder()


def test_lost_packets_are_counted_and_their_sweep_is_incomplete(maker):
    timed = maker.timed()
    whole, _ = decoded(maker.decoder(), timed)
    sweeps, reception = decoded(maker.decoder(), [p for i, p in enumerate(timed) if i not in maker.lost])
    assert (reception.lost, reception.refused) == (3, {})
    assert [s.complete for s in whole] == [True] * len(sweeps)
    assert [s.complete for s in sweeps].count(False) == 1
    kept = [i for i, s in enumerate(sweeps) if s.complete]
    assert equal([sweeps[i] for i in kept], [whole[i] for i in kept])


def test_overtaken_and_doubled_packets_change_nothing(maker):
    timed = maker.timed()
    whole, _ = decoded(maker.decoder(), timed)
    at = maker.lost[0]
    timed[at], timed[at + 1] = timed[at + 1], timed[at]
    timed.insert(at + 10, timed[at + 9])
    sweeps, reception = decoded(maker.decoder(), timed)
    assert equal(sweeps, whole)
    assert reception.lost == 0
    assert set(reception.refused) <= {"late or twice"}


def test_garbage_and_foreign_packets_are_counted_and_change_nothing(maker, caplog, rng):
    timed = maker.timed()
    dirty = list[Timed]()
    n = 0
    whole, _ = decoded(maker.decoder(), timed)
    caplog.clear()
    for i, (at_s, payload) in enumerate(timed):
        dirty.append((at_s, payload))
        if i > 30 and not i % 50:
            n += 1
            junk = [rng.bytes(len(payload) + 1), b"", payload[: len(payload) // 2], maker.broken(payload)]
            dirty += [(at_s, p) for p in junk + ([maker.foreign(payload)] if maker.foreign else [])]
    sweeps, reception = decoded(maker.decoder(), dirty)
    assert equal(sweeps, whole)
    assert reception.lost == 0
    assert reception.refused == {reason: n * count for reason, count in maker.refused.items()}
    assert sum("only counted" in r.message for r in caplog.records) == len(maker.refused)  # one line a reason


@pytest.mark.parametrize("name", ["velodyne", "hesai", "livox", "robosense"])
def test_a_sweep_holds_no_more_packets_than_a_sensor_sends(name):
    stamped = makers.MAKERS[name].stamped
    decoder = MAKERS[name].decoder()
    timed = MAKERS[name].timed()
    at = MAKERS[name].lost[0]
    for at_s, payload in timed[:at]:
        decoder.decode(at_s, stamped(payload, at_s))
    for k in range(3000):
        decoder.decode(at_s, stamped(payload, at_s - 0.01 * k / 3000))
    assert makers.is_bounded(decoder)
    assert decoder.reception.refused["more than a turn has; do several sensors send to this port?"] > 1000
    sweeps = [s for at_s, payload in timed[at:] for s in decoder.decode(at_s, stamped(payload, at_s))]
    assert sweeps[-1].complete  # the sensor's own packets go on


CLOUDS = {  # recorded packets: name, calibration, number of sweeps, greatest median distance [m]
    "vlp16-1673400471837873222": (None, 3, 0.01),  # two returns a firing
    "vlp32-1713492677464078412": (None, 4, 0.01),  # set to see the front half only
    "vls128-1614315746471294674": (None, 3, 0.03),
    "40p-1673400149412331409": ("Pandar40P", 3, 1e-4),
    "64-1673403880599376836": ("Pandar64", 3, 1e-4),
    "qt64-1673401195788312575": ("PandarQT64", 3, 1e-4),
    "qt128-1730273789074637152": ("PandarQT128", 1, 1e-4),
    "xt16-1732848127890747768": ("PandarXT16", 2, 1e-4),
    "xt32-1673400677802009732": ("PandarXT32", 3, 1e-4),
    "xt32m-1660893203042895158": ("PandarXT32M", 3, 1e-4),
}


@pytest.mark.kitti
@pytest.mark.parametrize("name", CLOUDS)
def test_points_are_those_of_another_decoder(kitti_root, name):
    table, n_sweeps, median_m = CLOUDS[name]
    folder = kitti_root / "packets" / name
    (cloud,) = folder.glob("*.pcd")
    theirs = read_pcd(cloud.read_bytes())[:, :3]  # cut elsewhere, with both returns
    if table is None:
        sweeps, reception = decoded(VelodyneDecoder("sensor"), packets_of_bag(folder))
        assert reception.lost == 0
        assert all(s.complete for s in sweeps)
    else:
        angles_deg = read_angles(folder.parent / "calibration" / f"{table}.csv")
        sweeps, reception = decoded(HesaiDecoder("sensor", angles_deg), packets_of_bag(folder))
        assert [s.turn_s for s in sweeps] == pytest.approx([0.1] * n_sweeps, abs=2e-4)
        theirs = theirs[:, [1, 0, 2]] * [1, -1, 1]  # x right, y forward
    assert (len(sweeps), reception.refused) == (n_sweeps, {})
    distance, _ = cKDTree(np.concatenate([s.points[:, :3] for s in sweeps])).query(theirs)
    assert np.median(distance) < median_m
    assert np.quantile(distance, 0.9) < max(5 * median_m, 0.02)
