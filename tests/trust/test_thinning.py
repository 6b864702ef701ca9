"""Returns that thin out slowly in all directions are reported, and with nothing wrong none are."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from modt.profile import load
from modt.trust.sample import DOWN_SHARE, sample
from modt.trust.thinning import ThinningHistory
from modt.trust.tuning import ThinningTuning
from modt.trust.watch import TrustWatch
from modt.types import Frame, TrustLevel
from modt_simulation.synthetic_stream import SyntheticStream

LOOK_S = 0.6
BEGIN_S = 12.0


@cache
def sweeps(sensor):
    """Sweeps of a robot in a yard, of which the last ones are repeated as if it stood."""
    return [frame.points for frame in SyntheticStream("yard", sensor, 1.0, seed=12)]


def missing_shares(change, seconds, sensor="vlp-16"):
    """Share that is missing after each look at sweeps that change from BEGIN_S on, with the time since."""
    history = ThinningHistory(ThinningTuning())
    for k in range(int((BEGIN_S + seconds) / LOOK_S)):
        points = sweeps(sensor)[k % len(sweeps(sensor))]
        points = change(points, max(k * LOOK_S - BEGIN_S, 0.0))
        history.add(sample(Frame(k, k * LOOK_S, points), np.eye(4), load(sensor).sensor, np.zeros(3)))
        yield history.missing_share


def thinned(share, within_s):
    """Returns that are lost by chance, up to a share after a time."""

    def change(points, since_s):
        lost = share * min(since_s / within_s, 1.0)
        return points[np.random.default_rng(round(10 * since_s)).random(len(points)) >= lost]

    return change


@pytest.mark.parametrize("sensor", ["vlp-16", "os1-64"])
@pytest.mark.parametrize("within_s", [5.0, 60.0])
@pytest.mark.parametrize("share", [0.35, 0.6, 0.9])
def test_returns_that_fade_are_reported_with_their_share(share, within_s, sensor):
    *_, missing_share = missing_shares(thinned(share, within_s), within_s + 15.0, sensor)
    assert ThinningTuning().missing_share < missing_share < share + 0.05


def test_returns_that_come_back_are_no_longer_missing():
    faded = lambda points, since_s: thinned(0.6, 5.0)(points, since_s if since_s < 30.0 else 0.0)  # noqa: E731
    shares = list(missing_shares(faded, 90.0))
    assert max(shares) > 0.4
    assert shares[-1] == 0.0


@pytest.mark.parametrize(
    "change",
    [
        lambda points, since_s: points,
        thinned(0.1, 30.0),
        # A yard that the robot leaves: what is not below the sensor is gone.
        lambda points, since_s: points[points[:, 2] < -DOWN_SHARE * np.hypot(points[:, 0], points[:, 1])],
        # A drop to the left and ahead.
        lambda points, since_s: points[(points[:, 1] < 1.0) & (points[:, 0] < 3.0)] if since_s else points,
    ],
    ids=["none", "a tenth", "open ground", "a drop"],
)
def test_a_change_of_the_scene_is_no_loss(change):
    assert not any(missing_shares(change, 60.0))


def test_a_sensor_that_hardly_looks_down_is_not_judged():
    assert not any(missing_shares(thinned(0.9, 5.0), 30.0, "mid-360"))


def test_the_watch_reports_a_lens_that_fogs():
    stream = SyntheticStream("yard", "vlp-16", 44.0, seed=12)
    watch = TrustWatch(load("vlp-16").sensor)
    found = []
    for k in range(0, 440, 3):
        frame, _ = stream.simulator.sweep(k)
        points = thinned(0.4, 24.0)(frame.points, max(k / 10 - 15.0, 0.0))
        found.append(watch.add(replace(frame, points=points), frame.T_world_sensor))
    assert {trust.level for trust in found[:50]} == {TrustLevel.GOOD}
    assert found[-1].level == TrustLevel.DEGRADED
    assert "fading" in found[-1].keys
