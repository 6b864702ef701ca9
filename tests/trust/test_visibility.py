"""The visibility follows the share of returns of the air."""

import math

import numpy as np
import pytest

from modt.config import SensorConfig
from modt.trust.tuning import VisibilityTuning
from modt.trust.visibility import CONTRAST, VisibilityEstimate
from modt.types import PointKind

TUNING = VisibilityTuning()
SENSOR = SensorConfig(azimuth_step_deg=3.6, elevation_step_deg=10.0, elevation_span_deg=(-45.0, 45.0))
"""A sensor of 1,000 rays."""


def sweep(share, n=1000):
    kind = np.zeros(n + 50, np.int8)
    kind[: round(share * n)] = PointKind.AIRBORNE
    kind[n:] = PointKind.OUT_OF_RANGE
    return kind


def after(*parts):
    """Estimate after parts of (share, seconds) at 10 Hz."""
    estimate = VisibilityEstimate(SENSOR)
    time_s = 0.0
    for share, seconds in parts:
        for _ in range(round(10 * seconds)):
            estimate.add(sweep(share), time_s)
            time_s += 0.1
    return estimate


@pytest.mark.parametrize("visibility_m", [30.0, 50.0, 100.0, 400.0])
def test_fog_has_its_visibility(visibility_m):
    share = 1 - math.exp(-CONTRAST / visibility_m * TUNING.depth_m)
    assert after((share, 1.0)).visibility_m == pytest.approx(visibility_m, rel=0.05)


def test_single_flakes_are_no_fog():
    estimate = after((0.025, 200.0))
    assert estimate.visibility_m is None
    assert not estimate.findings()


def test_fog_that_comes_is_reported_within_two_seconds_and_one_that_goes_is_not():
    estimate = after((0.0, 5.0), (0.5, 2.0))
    assert estimate.visibility_m == pytest.approx(52, abs=5)
    assert "about 2" in estimate.findings()["visibility"].cause
    assert not after((0.5, 5.0), (0.0, 5.0)).findings()


def test_a_stream_without_kinds_has_no_visibility():
    estimate = VisibilityEstimate(SENSOR)
    estimate.add(None, 0.0)
    assert estimate.visibility_m is None
