"""Doubts that the first sweeps of a source raise without any history."""

from functools import cache

import numpy as np
import pytest

from modt.profile import load
from modt.trust.first_sweeps import doubts
from modt_simulation.synthetic_stream import SyntheticStream

SENSOR = load("vlp-16").sensor


@cache
def sweeps():
    return [frame.points for frame in SyntheticStream("street", "vlp-16", 0.3, seed=2)]


def test_a_street_raises_no_doubt():
    assert list(doubts(sweeps(), SENSOR)) == []


@pytest.mark.parametrize(
    ("change", "useless", "words"),
    [
        (lambda each: each[:1] * 2, True, "same sweep"),
        (lambda each: [p[p[:, 0] > 0] for p in each], False, "behind (180 deg)"),
        (lambda each: [p[::33] for p in each], True, "returns of about"),
        (lambda each: [p[np.abs(p[:, 2] / np.hypot(*p.T[:2]) + 0.017) < 0.01] for p in each], True, "one elevation"),
        (lambda each: [p * np.float32([0.2, 0.2, 0.2, 1]) for p in each], False, "nine tenths"),
        (lambda each: [p[:0] for p in each], True, "0 returns"),
    ],
    ids=["frozen", "half a circle", "few points", "one ring", "fog", "empty"],
)
def test_a_view_that_is_not_whole_is_doubted(change, useless, words):
    found = list(doubts(change(sweeps()), SENSOR))
    assert any(is_useless == useless and words in what for is_useless, what, _ in found)
