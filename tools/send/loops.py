"""Endless repetition of captured packets, with stamps and frame numbers that continue."""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterator, Sequence
from itertools import count
from pathlib import Path

import numpy as np

from modt.errors import MisuseError
from modt.sources.drivers import hesai, livox
from modt.sources.drivers.velodyne import AZIMUTHS, STAMP_AT
from modt.sources.packets.packet_decoder import import_extra
from modt.sources.packets.turn_decoder import TURN
from tools.send.faults import Timed


def endless(payloads: Sequence[bytes]) -> Iterator[Timed]:
    """Repeat the packets of a Velodyne, a Hesai or a Livox as if the sensor went on.

    Raises:
        MisuseError: the packets hold no whole turn of a head, or are an Avia's.
    """
    sender = livox.sender_of(payloads[0])
    if sender == livox.AVIA:
        raise MisuseError("capture", "packets of an Avia are not repeated", "give --once")
    return turn_loop(payloads) if sender is None else livox_loop(payloads)


def livox_loop(payloads: Sequence[bytes]) -> Iterator[Timed]:
    """Repeat the packets of a Livox endlessly."""
    stamps_ns = [int(livox.HEADER.unpack_from(p)[-1]) for p in payloads]
    step_ns = float(np.median(np.diff(stamps_ns)))
    sweeps = max(round((stamps_ns[-1] - stamps_ns[0] + step_ns) / livox.SWEEP_NS), 1)
    for loop in count():
        for stamp_ns, payload in zip(stamps_ns, payloads, strict=True):
            ahead_ns = loop * sweeps * livox.SWEEP_NS
            body = struct.pack("<Q", stamp_ns + ahead_ns) + payload[livox.HEADER.size :]
            at_s = (stamp_ns + ahead_ns - stamps_ns[0] + step_ns) * 1e-9
            yield at_s, payload[:24] + struct.pack("<I", zlib.crc32(body)) + body


def turn_loop(payloads: Sequence[bytes]) -> Iterator[Timed]:
    """Repeat the whole turns of a Velodyne's or a Hesai's packets endlessly.

    Raises:
        MisuseError: the packets hold no whole turn.
    """
    model = hesai.model_of(payloads[0])
    wire = VelodyneStamps() if model is None else HesaiStamps(model)
    phases = np.array([(wire.azimuth(p) + TURN // 2) % TURN for p in payloads])
    seams = np.flatnonzero(np.diff(phases) < 0) + 1
    if len(seams) < 2:
        raise MisuseError("capture", "no whole turn to repeat", "give a longer one, or --once")
    stamps_us = [wire.stamp_us(p) for p in payloads]
    first = int(seams[0])
    end = int(seams[-1])
    duration_us = (stamps_us[end] - stamps_us[first]) % wire.wrap_us
    for turn in count():
        for i in range(first, end):
            at_us = turn * duration_us + (stamps_us[i] - stamps_us[first]) % wire.wrap_us
            yield at_us * 1e-6, wire.stamped(payloads[i], (stamps_us[first] + at_us) % wire.wrap_us)


class VelodyneStamps:
    """Azimuth and time in a Velodyne's packets."""

    wrap_us = 3_600_000_000

    def azimuth(self, payload: bytes) -> int:
        """Azimuth of the first block [0.01 deg]."""
        return int(AZIMUTHS.unpack_from(payload)[0])

    def stamp_us(self, payload: bytes) -> int:
        """Time of the packet [us]."""
        return int.from_bytes(payload[STAMP_AT : STAMP_AT + 4], "little")

    def stamped(self, payload: bytes, stamp_us: int) -> bytes:
        """Packet with another time."""
        return payload[:STAMP_AT] + struct.pack("<I", stamp_us) + payload[STAMP_AT + 4 :]


class HesaiStamps:
    """Azimuth and time in a Hesai's packets."""

    wrap_us = 86_400_000_000

    def __init__(self, model: hesai.Model) -> None:
        self._model = model
        self._hour_at = model.tail + model.layout.date + 3
        self._micros_at = model.tail + model.layout.micros

    def azimuth(self, payload: bytes) -> int:
        """Azimuth of the first block [0.01 deg]."""
        return int(self._model.azimuths.unpack_from(payload)[0])

    def stamp_us(self, payload: bytes) -> int:
        """Time of the packet [us]."""
        hour, minute, second = payload[self._hour_at :][:3]
        micros = int.from_bytes(payload[self._micros_at :][:4], "little")
        return (hour * 3600 + minute * 60 + second) * 1_000_000 + micros

    def stamped(self, payload: bytes, stamp_us: int) -> bytes:
        """Packet with another time."""
        out = bytearray(payload)
        second, micros = divmod(stamp_us, 1_000_000)
        out[self._hour_at : self._hour_at + 3] = second // 3600, second // 60 % 60, second % 60
        out[self._micros_at : self._micros_at + 4] = struct.pack("<I", micros)
        return bytes(out)


def ouster_loop(payloads: Sequence[bytes], metadata: Path) -> Iterator[Timed]:
    """Repeat the frames of an Ouster's packets endlessly."""
    sdk = import_extra("ouster.sdk.core", "ouster")
    info = sdk.SensorInfo(metadata.read_text("utf-8"))
    layout = sdk.PacketFormat(info)
    columns = info.format.columns_per_packet
    period_ns = round(1e9 / info.format.fps)
    raw = [np.frombuffer(p, np.uint8) for p in payloads]
    stamps_ns = np.array([layout.packet_header(sdk.ColHeader.TIMESTAMP, r).astype(np.int64) for r in raw])
    ids = np.array([layout.frame_id(r) for r in raw])
    n_frames = int(ids.max() - ids.min()) + 1
    for loop in count():
        for i, bytes_ in enumerate(raw):
            packet = sdk.LidarPacket(layout)
            packet.buf[:] = bytes_
            layout.set_frame_id(packet, int(ids[i] + loop * n_frames) % (layout.max_frame_id + 1))
            for column in range(columns):
                layout.set_col_timestamp(packet, column, int(stamps_ns[i, column]) + loop * n_frames * period_ns)
            at_ns = int(stamps_ns[i, -1] - stamps_ns[0, 0]) + loop * n_frames * period_ns
            yield at_ns * 1e-9, packet.buf.tobytes()
