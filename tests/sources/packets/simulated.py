"""Packets of simulated sensors."""

from collections.abc import Iterable, Sequence
from functools import cache

import numpy as np

from modt.sources.packets.packet_decoder import PacketDecoder
from modt.sources.stream import Reception, Sweep
from modt.types import Float32, Frame
from modt_simulation.synthetic_stream import SyntheticStream
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
    """Sweeps of packets, and the counts of the decoder."""
    sweeps = [sweep for at_s, payload in timed for sweep in decoder.decode(at_s, payload)]
    return [*sweeps, *decoder.finish()], decoder.reception


def bearing_deg(points: Float32) -> Float32:
    angle: Float32 = np.rad2deg(np.arctan2(points[:, 1], points[:, 0]))
    return angle


def equal(a: Sequence[Sweep], b: Sequence[Sweep]) -> bool:
    return len(a) == len(b) and all(
        x.points.tobytes() == y.points.tobytes() and x.complete == y.complete for x, y in zip(a, b, strict=True)
    )
