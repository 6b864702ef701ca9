"""Captures, packets, recordings and messages of ROS 2, datagrams."""

import struct

import numpy as np
import pytest

from modt.poses.pose_socket import read_datagram
from modt.ros2.cdr import MessageError
from modt.ros2.odometry import Transforms, read_odometry, write_odometry
from modt.ros2.point_cloud2 import read_cloud, write_cloud
from modt.sources.drivers.hesai import HesaiDecoder, read_angles
from modt.sources.drivers.livox import LivoxDecoder
from modt.sources.drivers.ouster import OusterDecoder
from modt.sources.drivers.robosense import RobosenseDecoder
from modt.sources.drivers.velodyne import VelodyneDecoder
from modt.sources.packets.pcap_file import PcapFile
from modt.sources.recognise import open_stream
from tests.fuzz.target import of_file, target, targets_of_files
from tests.ros2 import messages
from tests.sources import bags, layouts
from tests.sources.packets import pcapng
from tests.sources.packets.robosense_packets import WRITTEN
from tests.sources.packets.simulated import packets
from tools.send.ideal_packets import LAYOUTS, ideal_calibration
from tools.send.pcap_writer import ethernet, ipv4, udp, write_capture

LENGTH = struct.Struct("<Id")
"""Header of a packet in an input: its length, and the time of its reception."""


targets_of_files(
    {
        "hesai_calibration": ("ideal.csv", read_angles, [ideal_calibration(LAYOUTS["xt-32"])]),
        "velodyne_calibration": (
            "ideal.yaml",
            lambda path: VelodyneDecoder("sensor", None, path),
            [ideal_calibration(LAYOUTS["vlp-16"])],
        ),
    }
)


@target()
def pcap(folder):
    path = folder / "a.pcap"
    write_capture(path, [(1.5, b"first"), (2.5, bytes(100))], 2368)
    whole = path.read_bytes()
    datagram = udp(bytes(64), 2368)
    parts = [ipv4(datagram[at : at + 40], identity=7, offset=at, more=not at) for at in (0, 40)]
    frames = [ethernet(part) for part in parts]
    fragmented = whole[:24] + b"".join(struct.pack("<IIII", 1, 0, len(f), len(f)) + f for f in frames)
    blocks = pcapng.captured([(1.5, b"first"), (2.5, bytes(100))], 2368)
    return of_file(path, lambda: list(PcapFile(path)), whole, fragmented, blocks)


@target()
def velodyne_packets(folder):
    return _of_packets(VelodyneDecoder("sensor"), _framed(packets("vlp-16", 3)[60:180]))


@target()
def hesai_packets(folder):
    return _of_packets(HesaiDecoder("sensor"), _framed(packets("xt-32", 2)[100:500]))


@target()
def livox_packets(folder):
    return _of_packets(LivoxDecoder("sensor"), _framed(packets("mid-360", 3)[150:450]))


@target()
def avia_packets(folder):
    row = struct.pack("<iiiBB", 1500, -2500, 250, 51, 0)
    heads = [bytes((5, 0, 1, 0, 0, 0, 0, 0, 0, 4)) + struct.pack("<Q", 400_000 * k) for k in range(600)]
    return _of_packets(LivoxDecoder("sensor"), _framed([(1.0, head + 96 * row) for head in heads]))


@target()
def robosense_packets(folder):
    decoder = RobosenseDecoder("sensor")
    decoder.describe(WRITTEN["bpearl"].difop())
    return _of_packets(decoder, _framed(WRITTEN["bpearl"].turns(1.7)[:300]))


@target()
def robosense_difop(folder):
    model = WRITTEN["airy"]
    timed = model.turns(1.2)[::8]

    def call(raw):
        decoder = RobosenseDecoder("sensor")
        decoder.describe(raw)
        for at_s, payload in timed:
            decoder.decode(at_s, payload)
            decoder.describe(raw)
        decoder.finish()

    return [model.difop()], call


@target()
def ouster_packets(folder):
    sdk = pytest.importorskip("ouster.sdk.core", reason="needs the extra [ouster]")
    info = sdk.SensorInfo.from_default(sdk.LidarMode._512x10)
    path = folder / "metadata.json"
    path.write_text(info.to_json_string())
    form = sdk.PacketFormat(info)
    timed = []
    for index in range(2):
        frame = sdk.LidarFrame(info)
        frame.frame_id = index
        frame.field("RANGE")[:] = 5000
        frame.timestamp[:] = 1_000_000_000 + 100_000_000 * index + np.arange(512) * 195_000
        frame.status[:] = 1
        sent = sdk.frame_to_packets(frame, sdk.PacketFormat(info), 0, 0)
        timed += [(1.0 + 0.1 * index, bytes(p.buf)) for p in sent if isinstance(p, sdk.LidarPacket)]
    assert len(timed[0][1]) == form.lidar_packet_size
    return _of_packets(OusterDecoder("sensor", path), _framed(timed))


@target()
def ouster_metadata(folder):
    sdk = pytest.importorskip("ouster.sdk.core", reason="needs the extra [ouster]")
    path = folder / "metadata.json"
    seed = sdk.SensorInfo.from_default(sdk.LidarMode._512x10).to_json_string()
    return of_file(path, lambda: OusterDecoder("sensor", path), seed)


@target()
def database(folder):
    written = bags.write_rosbag2(folder / "bag", bags.by_time(bags.clouds(2), bags.poses()[:12]))
    (path,) = written.glob("*.db3")
    read = folder / "read.db3"
    return of_file(read, lambda: list(open_stream(read)), path.read_bytes())


@target()
def mcap(folder):
    recorded = bags.by_time(bags.clouds(2), bags.poses()[:12])
    whole = bags.write_mcap(folder / "whole", recorded, chunk_size=1000).read_bytes()
    read = folder / "read.mcap"
    return of_file(read, lambda: list(open_stream(read)), whole, whole[: 3 * len(whole) // 4])


@target(MessageError)
def point_cloud(folder):
    plain = write_cloud(1.5, "lidar", layouts.scan(0))
    timed = np.zeros((2, 100), [*messages.XYZ, ("intensity", "u2"), ("t", "u4")])
    turn = np.linspace(3.1, -3.1, 200).reshape(2, 100)
    timed["x"] = np.cos(turn)
    timed["y"] = np.sin(turn)
    timed["t"] = (turn.max() - turn) / 6.2 * 1e8
    return [plain, messages.encode(messages.cloud(timed, padding=4))], read_cloud


@target(MessageError)
def odometry(folder):
    return [write_odometry(1.5, "odom", "base_link", np.eye(4))], read_odometry


@target(MessageError)
def transforms(folder):
    def call(raw):
        found = Transforms()
        found.add(raw)
        found.between("base_link", "lidar")

    up = [0.0, 0.0, 0.0, 1.0]
    edges = [("base_link", "mast", [0.0, 0.0, 1.0], up), ("mast", "lidar", [0.0, 0.0, 1.0], up)]
    return [messages.encode(messages.transforms(*edges))], call


@target(MessageError)
def pose_datagram(folder):
    matrix = [1, 0, 0, 5, 0, 1, 0, 0, 0, 0, 1, 0]
    return [
        b'{"stamp": 1.5, "x": 1, "y": 2.5, "yaw": 0.1}',
        f'{{"stamp": 1.5, "pose": {matrix}}}'.encode(),
        f'{{"stamp": 1.5, "pose": {[*matrix, 0, 0, 0, 1]}}}'.encode(),
    ], read_datagram


def _framed(timed):
    return b"".join(LENGTH.pack(len(payload), at_s) + payload for at_s, payload in timed)


def _of_packets(decoder, seed):
    """A sensor's packets with their lengths and times, by a decoder that has seen none."""

    def call(raw):
        fresh = decoder.fresh()
        at = 0
        while at + LENGTH.size <= len(raw):
            length, received_s = LENGTH.unpack_from(raw, at)
            at += LENGTH.size
            received_s = received_s if abs(received_s) < 1e10 else 0.0  # of the host's clock, no outside bytes
            fresh.decode(received_s, raw[at : at + min(length, 65_535)])
            at += length
        fresh.finish()

    return [seed], call
