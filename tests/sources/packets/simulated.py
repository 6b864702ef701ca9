"""Packets of simulated sensors."""

from functools import cache

import numpy as np

from modt.types import Float32
from modt_simulation.synthetic_stream import SyntheticStream
from tools.send.ideal_packets import packets_of

BEGAN_S = 1.6e9


@cache
def scene(model, sweeps):
    """Sweeps in the synthetic street."""
    return list(SyntheticStream("street", model, 0.1 * sweeps, seed=1))


@cache
def packets(model="vlp-16", sweeps=5):
    """Packets of an ideal sensor in the scene: a turn that had begun, whole ones, and one cut short."""
    return tuple((BEGAN_S + at_s, payload) for at_s, payload in packets_of(scene(model, sweeps), model, 0.1))


def decoded(decoder, timed):
    """Sweeps of packets, and the counts of the decoder."""
    sweeps = [sweep for at_s, payload in timed for sweep in decoder.decode(at_s, payload)]
    return [*sweeps, *decoder.finish()], decoder.reception


def bearing_deg(points):
    angle: Float32 = np.rad2deg(np.arctan2(points[:, 1], points[:, 0]))
    return angle


def equal(a, b):
    return len(a) == len(b) and all(
        x.points.tobytes() == y.points.tobytes() and x.complete == y.complete for x, y in zip(a, b, strict=True)
    )
