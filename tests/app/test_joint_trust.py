"""The trust in a robot with two sensors."""

from dataclasses import replace

import numpy as np
import pytest

from modt.app.assembly import sensor_profile
from modt.app.joint_trust import SILENT_S, JointWatch
from modt.trust.watch import Finding
from modt.types import Frame, Reason, Trust, TrustLevel
from tests.robots import CORNERS

PERIOD_S = 0.1


def sweep(stamp_s):
    """A sweep of noise, which no check holds anything against within the first second."""
    points = np.random.default_rng(round(stamp_s * 10)).uniform(1, 20, (500, 4)).astype(np.float32)
    return Frame(0, stamp_s, points)


def frame(k, *present):
    stamp_s = k * PERIOD_S
    sweeps = tuple(sweep(stamp_s) if each else None for each in present)
    return replace(sweep(stamp_s), index=k, sweeps=sweeps)


@pytest.fixture
def watch():
    return JointWatch([(mounted, sensor_profile(mounted).sensor) for mounted in CORNERS])


def follow(watch, frames, others=None):
    for each in frames:
        trust = watch.add(each, np.eye(4), others or {})
    return trust


def test_a_silent_sensor_degrades_the_trust_and_is_named_since_its_last_sweep(watch):
    assert follow(watch, [frame(k, True, True) for k in range(4)]).level is TrustLevel.GOOD
    last_s = 3 * PERIOD_S
    trust = follow(watch, [frame(k, True, False) for k in range(4, 11)])
    assert trust.level is TrustLevel.DEGRADED
    (reason,) = trust.reasons
    assert (reason.key, reason.cause) == ("rear/silent", f"sensor rear is silent since {last_s:.1f} s")
    assert trust.since_s == pytest.approx(last_s + SILENT_S, abs=PERIOD_S + 1e-6)
    assert follow(watch, [frame(11, True, True)]).level is TrustLevel.GOOD


def test_a_sensor_that_was_never_heard_is_silent_since_the_first_frame(watch):
    trust = follow(watch, [frame(k, True, False) for k in range(8)])
    assert [reason.cause for reason in trust.reasons] == ["sensor rear is silent since 0.0 s"]


BLIND = Trust(TrustLevel.BLIND, 0.0, (Reason("returns", TrustLevel.BLIND, "few returns", "clean it", 0.0),))
FROZEN = Trust(TrustLevel.BLIND, 0.0, (Reason("frozen", TrustLevel.BLIND, "the same sweep", "restart it", 0.0),))


@pytest.mark.parametrize(
    ("verdicts", "level"),
    [
        ((BLIND, Trust()), TrustLevel.DEGRADED),
        ((BLIND, BLIND), TrustLevel.BLIND),
        ((FROZEN, Trust()), TrustLevel.BLIND),
    ],
    ids=["one sees nothing", "none sees anything", "one misleads"],
)
def test_what_one_sensor_does_not_see_degrades_and_what_misleads_counts_in_full(watch, verdicts, level):
    for part, verdict in zip(watch._watches, verdicts, strict=True):
        part.trust = verdict
        part.add = lambda *_: None
    trust = follow(watch, [frame(0, True, True)])
    assert trust.level is level
    assert trust.reasons[0].key.startswith("front/")
    assert trust.reasons[0].cause.startswith("sensor front: ")


def test_findings_of_no_sensor_are_reasons_as_they_are(watch):
    poses = {"poses": Finding(TrustLevel.DEGRADED, "they leap", "mend them")}
    trust = follow(watch, [frame(k, True, True) for k in range(20)], poses)
    assert [reason.key for reason in trust.reasons] == ["poses"]
