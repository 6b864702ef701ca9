"""Sweeps that are missing, by stamps."""

import numpy as np
import pytest

from modt.sources.live.ros2 import MissingSweeps


def missing(stamps):
    counter = MissingSweeps()
    return [counter.before(stamp_s) for stamp_s in stamps]


@pytest.mark.parametrize("share", [0.1, 0.3, 0.5])
def test_those_that_are_lost_are_counted_whatever_their_share(share):
    rng = np.random.default_rng(0)
    kept = np.flatnonzero(rng.uniform(size=1000) > share)
    lost = kept[-1] - kept[0] + 1 - len(kept)
    assert sum(missing(kept * 0.05)) == pytest.approx(lost, abs=3)


def test_jitter_of_the_stamps_is_no_loss():
    rng = np.random.default_rng(0)
    assert sum(missing(0.1 * np.arange(500) + rng.uniform(-0.02, 0.02, 500))) == 0


def test_silence_and_a_clock_that_is_set_are_no_loss():
    stamps = [*np.arange(20) / 10, *(100 + np.arange(20) / 10), *np.arange(20) / 10]
    assert sum(missing(stamps)) == 0
