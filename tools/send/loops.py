"""Captured packets, over and over, as if the sensor had gone on: its stamps and frame numbers continue."""

from __future__ import annotations

import struct
from collections.abc import Iterator, Sequence
from itertools import count
from pathlib import Path

import numpy as np

from modt.errors import MisuseError
from modt.sources.packets.packet_decoder import extra
from modt.sources.packets.velodyne_models import STAMP_AT, TURN, azimuths
from tools.send.faults import Timed

HOUR_US = 3_600_000_000


def velodyne_loop(payloads: Sequence[bytes]) -> Iterator[Timed]:
    """The whole turns of a Velodyne's packets, endlessly.

    Raises:
        MisuseError: there is no whole turn.
    """
    phases = np.array([(azimuths(p)[0] + TURN // 2) % TURN for p in payloads])
    seams = np.flatnonzero(np.diff(phases) < 0) + 1
    if len(seams) < 2:
        raise MisuseError("capture", "no whole turn to repeat", "give a longer one, or --once")
    stamps_us = [struct.unpack_from("<I", p, STAMP_AT)[0] for p in payloads]
    first, end = int(seams[0]), int(seams[-1])
    duration_us = (stamps_us[end] - stamps_us[first]) % HOUR_US
    for turn in count():
        for i in range(first, end):
            at_us = turn * duration_us + (stamps_us[i] - stamps_us[first]) % HOUR_US
            stamp = struct.pack("<I", (stamps_us[first] + at_us) % HOUR_US)
            yield at_us * 1e-6, payloads[i][:STAMP_AT] + stamp + payloads[i][STAMP_AT + 4 :]


def ouster_loop(payloads: Sequence[bytes], metadata: Path) -> Iterator[Timed]:
    """The frames of an Ouster's packets, endlessly."""
    sdk = extra("ouster.sdk.core", "ouster")
    info = sdk.SensorInfo(metadata.read_text("utf-8"))
    layout, columns = sdk.PacketFormat(info), info.format.columns_per_packet
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
