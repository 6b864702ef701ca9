"""Findings about a live source, and the trust of a run."""

import pytest

from modt.app.trust_report import TrustReport, source_findings
from modt.profile import load
from modt.sources.stream import OTHER_SENSOR
from modt.types import TrustLevel


def health(period_s=0.1, **refused):
    return {"period_s": period_s, "refused_messages": refused}


@pytest.mark.parametrize("period_s", [0.0, 0.011, 0.05, 0.2], ids=["at once", "many sensors", "20 Hz", "5 Hz"])
def test_a_rate_that_is_not_the_nominal_one_is_a_reason(period_s):
    found = source_findings(health(period_s), {}, 0.1)
    assert list(found) == ["period"]
    assert found["period"].level is TrustLevel.DEGRADED
    assert f"{period_s:.3f} s, not every 0.100 s" in found["period"].cause


@pytest.mark.parametrize("period_s", [0.08, 0.1, 0.13])
def test_a_rate_near_the_nominal_one_is_none(period_s):
    assert not source_findings(health(period_s), {}, 0.1)


def test_packets_of_a_second_head_are_a_reason_while_they_come():
    few = health(**{OTHER_SENSOR: 5, "too short": 7})
    assert list(source_findings(few, {}, 0.1)) == ["port"]
    assert not source_findings(few, few, 0.1)
    assert list(source_findings(health(**{OTHER_SENSOR: 6}), few, 0.1)) == ["port"]


def test_a_silent_sensor_is_blind_whatever_its_last_sweep_was():
    report = TrustReport(load("vlp-16").sensor)
    assert report.record()["level"] == "good"
    record = report.record(silent=True)
    assert record["level"] == "blind"
    assert [reason["check"] for reason in record["reasons"]] == ["silent"]
