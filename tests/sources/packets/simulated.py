"""Packets of simulated sensors."""

from functools import cache

import numpy as np
import pytest

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


def assert_whole_turn(sweep, reception, turn_s, ahead_s):
    """A sweep without faults, of a reflectance of 0.2, is stamped when the head looks straight ahead."""
    assert (reception.lost, reception.refused) == (0, {})
    assert sweep.complete
    assert sweep.turn_s == pytest.approx(turn_s, rel=1e-3)
    assert sweep.stamp_s == pytest.approx(ahead_s, abs=1e-3)
    assert sweep.points[:, 3] == pytest.approx(0.2)


def clockwise_rad(x, y):
    """Bearings of the returns of a beam, which is cut where it looks backwards itself."""
    bearing = np.unwrap(np.arctan2(y, x))
    assert np.all(np.diff(bearing) < 0)
    assert bearing[0] == pytest.approx(np.pi, abs=0.03)
    return bearing


def bearing_deg(points):
    angle: Float32 = np.rad2deg(np.arctan2(points[:, 1], points[:, 0]))
    return angle


def equal(a, b):
    return len(a) == len(b) and all(
        x.points.tobytes() == y.points.tobytes() and x.complete == y.complete for x, y in zip(a, b, strict=True)
    )
