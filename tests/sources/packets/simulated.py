"""Packets of simulated sensors."""

import sqlite3
import struct
from collections.abc import Iterable, Iterator, Sequence
from contextlib import closing
from functools import cache
from pathlib import Path

import numpy as np

from modt.sources.packets.packet_decoder import PacketDecoder
from modt.sources.stream import Reception, Sweep
from modt.types import Float32, Frame
from modt_desk.simulation.synthetic_stream import SyntheticStream
from tools.send.faults import Timed
from tools.send.ideal_packets import packets_of

BEGAN_S = 1.6e9


@cache
def scene(model: str, sweeps: int) -> list[Frame]:
    """Sweeps in the synthetic street."""
    return list(SyntheticStream("street", model, 0.1 * sweeps, seed=1))


@cache
def packets(model: str = "vlp-16", sweeps: int = 5) -> tuple[Timed, ...]:
    """Packets of an ideal sensor in the scene: a turn that had begun, whole ones, and one cut short."""
    return tuple((BEGAN_S + at_s, payload) for at_s, payload in packets_of(scene(model, sweeps), model, 0.1))


def decoded(decoder: PacketDecoder, timed: Iterable[Timed]) -> tuple[list[Sweep], Reception]:
    reception, sweeps = Reception(), list[Sweep]()
    for at_s, payload in timed:
        reception.messages += 1
        sweeps += decoder.decode(at_s, payload, reception)
    return [*sweeps, *decoder.finish(reception)], reception


def bearing_deg(points: Float32) -> Float32:
    angle: Float32 = np.rad2deg(np.arctan2(points[:, 1], points[:, 0]))
    return angle


def equal(a: Sequence[Sweep], b: Sequence[Sweep]) -> bool:
    return len(a) == len(b) and all(
        x.points.tobytes() == y.points.tobytes() and x.complete == y.complete for x, y in zip(a, b, strict=True)
    )


def packets_of_bag(folder: Path, size: int, length_at: int | None = None) -> Iterator[Timed]:
    """Packets in the messages of a maker's driver in a rosbag2 file, of a fixed size or with their length."""
    (path,) = folder.glob("*.db3")
    with closing(sqlite3.connect(f"file:{path}?mode=ro&immutable=1", uri=True)) as bag:
        messages = [data for (data,) in bag.execute("select data from messages order by timestamp")]
    for data in messages:
        at = 16 + struct.unpack_from("<I", data, 12)[0]
        at += -at % 4
        step = 8 + size + (-size % 4) + (0 if length_at is None else 4)
        for start in range(at + 4, at + 4 + step * struct.unpack_from("<I", data, at)[0], step):
            second, fraction = struct.unpack_from("<II", data, start)
            length = size if length_at is None else struct.unpack_from("<I", data, start + length_at)[0]
            yield second + 1e-9 * fraction, data[start + 8 : start + 8 + length]
