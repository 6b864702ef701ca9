"""Packets of each maker of sensors, with the time of a clock of the test."""

from __future__ import annotations

import importlib.util
import os
import struct
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from modt.sources.drivers import hesai, livox, robosense, velodyne
from modt.sources.packets.packet_decoder import PacketDecoder
from modt.sources.packets.pcap_file import PcapFile
from modt.sources.packets.turn_decoder import RECOGNISED_BY, TurnDecoder
from tests.sources.packets.robosense_packets import WRITTEN
from tests.sources.packets.simulated import packets
from tools.send.loops import HesaiStamps, VelodyneStamps

TURN_S = 0.1
OUSTER = "OS-1-128_v2.3.0_1024x10"
OUSTER_METADATA = Path(os.environ.get("KITTI_ROOT", "")) / "ouster" / f"{OUSTER}.json"


@dataclass(frozen=True)
class Maker:
    """A maker's sensor.

    Attributes:
        decoder: makes its decoder.
        turns: makes the packets of one turn of each of its models, the first of which is on the robot.
        stamped: gives a packet another time [s].
        fields: offsets of bytes that a decoder decides by.
        turned: gives the blocks of a packet other azimuths [0.01 deg]; None where it has none.
    """

    decoder: Callable[[], PacketDecoder]
    turns: Callable[[], Sequence[Sequence[bytes]]]
    stamped: Callable[[bytes, float], bytes]
    fields: tuple[int, ...]
    turned: Callable[[bytes, Sequence[int]], bytes] | None = None


def whole_turn(model: str) -> tuple[bytes, ...]:
    """Packets of one turn of a head."""
    payloads = [payload for _, payload in packets(model, 3)]
    wire: Any = HesaiStamps(_XT_32) if model == "xt-32" else VelodyneStamps()
    phases = np.array([(wire.azimuth(p) + 18_000) % 36_000 for p in payloads])
    first, end = (np.flatnonzero(np.diff(phases) < 0) + 1)[:2]
    return tuple(payloads[first:end])


def _of_wire(wire: VelodyneStamps | HesaiStamps) -> Callable[[bytes, float], bytes]:
    return lambda payload, at_s: wire.stamped(payload, round(at_s * 1e6) % wire.wrap_us)


def _azimuths(first: int, step: int, form: str = "<H") -> Callable[[bytes, Sequence[int]], bytes]:
    def turned(payload: bytes, azimuths: Sequence[int]) -> bytes:
        changed = bytearray(payload)
        for block, azimuth in enumerate(azimuths[: (len(payload) - first) // step]):
            struct.pack_into(form, changed, first + step * block, azimuth)
        return bytes(changed)

    return turned


_XT_32 = next(model for model in hesai.MODELS if model.profile == "xt-32")


def xt_16(payload: bytes) -> bytes:
    """The packet of a model with half the channels."""
    blocks = b"".join(payload[k : k + 66] for k in range(12, 1052, 130))
    return payload[:6] + b"\x10" + payload[7:12] + blocks + payload[1052:]


def _robosense_turn(name: str) -> tuple[bytes, ...]:
    """Packets of one turn, which begins behind the sensor."""
    timed = WRITTEN[name].turns(1.6)
    first = len(timed) * 5 // 16
    return tuple(payload for _, payload in timed[first : first + len(timed) * 10 // 16])


def _livox_stamped(payload: bytes, at_s: float) -> bytes:
    return payload[:28] + struct.pack("<Q", round(at_s * 1e9) % 2**64) + payload[livox.HEADER.size :]


@cache
def _ouster() -> tuple[Any, Any, tuple[bytes, ...]]:
    """Ouster's library, the facts of a sensor, and the packets of one of its frames."""
    import ouster.sdk.core as sdk

    info = sdk.SensorInfo(OUSTER_METADATA.read_text("utf-8"))
    layout = sdk.PacketFormat(info)
    captured = [d.payload for d in PcapFile(OUSTER_METADATA.with_name(f"{OUSTER}_lb_n3.pcap")) if d.port == 7502]
    ids = [layout.frame_id(np.frombuffer(p, np.uint8)) for p in captured]
    return sdk, info, tuple(p for p, frame in zip(captured, ids, strict=True) if frame == ids[0] + 1)


class OusterSensor:
    """An Ouster, whose frame number rises where its columns begin anew."""

    def __init__(self) -> None:
        self.frame = self.column = 0

    def decoder(self) -> PacketDecoder:
        """Decoder for a sensor that has just been switched on."""
        from modt.sources.drivers.ouster import OusterDecoder

        self.frame = self.column = 0
        return OusterDecoder("sensor", OUSTER_METADATA)

    def stamped(self, payload: bytes, at_s: float) -> bytes:
        """Packet with another time, in the present frame."""
        sdk, info, _ = _ouster()
        layout = sdk.PacketFormat(info)
        packet = sdk.LidarPacket(sdk.PacketFormat(info))
        packet.buf[:] = np.frombuffer(payload, np.uint8)
        first = int(layout.packet_header(sdk.ColHeader.MEASUREMENT_ID, packet.buf)[0])
        half = info.format.columns_per_frame // 2
        ahead = first - self.column
        if ahead < -half:
            self.frame += 1
            self.column = first
        else:
            self.column = max(self.column, first if ahead < half else 0)
        late = ahead >= half  # a packet of the frame before
        layout.set_frame_id(packet, (self.frame - late) % (layout.max_frame_id + 1))
        for column in range(info.format.columns_per_packet):
            sent_ns = round((at_s + column / info.format.columns_per_frame * TURN_S) * 1e9)
            layout.set_col_timestamp(packet, column, sent_ns % 10**18)  # no clock of a sensor is below 0
        return bytes(packet.buf.tobytes())


_OUSTER = OusterSensor()
MAKERS = {
    "velodyne": Maker(
        lambda: velodyne.VelodyneDecoder("sensor"),
        lambda: (whole_turn("vlp-16"), whole_turn("hdl-64e")),
        _of_wire(VelodyneStamps()),
        (0, 1, velodyne.IDENTITY_AT, velodyne.RETURN_AT),
        _azimuths(2, 100),
    ),
    "hesai": Maker(
        lambda: hesai.HesaiDecoder("sensor"),
        lambda: (whole_turn("xt-32"), tuple(map(xt_16, whole_turn("xt-32")))),
        _of_wire(HesaiStamps(_XT_32)),
        (0, 2, 6, 7, 9, _XT_32.tail + _XT_32.layout.mode),
        _azimuths(12, 130),
    ),
    "robosense": Maker(
        lambda: robosense.RobosenseDecoder("sensor"),
        lambda: (_robosense_turn("rs-16"), _robosense_turn("bpearl")),
        lambda payload, at_s: payload[:20] + WRITTEN["rs-16"].header(at_s % 86_400)[20:30] + payload[30:],
        (0, 2, 30, 31, 32, 42),
        _azimuths(44, 100, ">H"),
    ),
    "livox": Maker(
        lambda: livox.LivoxDecoder("sensor"),
        lambda: ([p for _, p in packets("mid-360", 2)][: len(packets("mid-360", 2)) // 2],),
        _livox_stamped,
        (0, 1, 5, 10, 35),
    ),
    "ouster": Maker(
        _OUSTER.decoder,
        lambda: (_ouster()[2],),
        _OUSTER.stamped,
        (0, 2, 4, 16, 32, 42),
    ),
}


def usable() -> list[str]:
    """Makers whose packets can be decoded here."""
    libraries = {"velodyne": "velodyne_decoder", "ouster": "ouster"}
    there = [name for name in MAKERS if name not in libraries or importlib.util.find_spec(libraries[name])]
    return [name for name in there if name != "ouster" or OUSTER_METADATA.is_file()]


def is_bounded(decoder: Any) -> bool:
    """Whether a decoder holds no more than a sweep and its neighbours."""
    if isinstance(decoder, livox.LivoxDecoder):
        return len(decoder._packets) <= livox.MAX_PACKETS
    if not isinstance(decoder, TurnDecoder):
        return True  # Ouster's library keeps one frame
    held = max(len(decoder._turn.entries), len(decoder._ending.entries)) <= decoder._max_packets + 200
    return held and max(len(decoder._unrecognised), len(decoder._foreign)) <= RECOGNISED_BY
