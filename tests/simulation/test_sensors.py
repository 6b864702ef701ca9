"""The sensor table against the profiles of the same names."""

import numpy as np
import pytest

from modt import profile
from modt.simulation.sensors import SENSORS


@pytest.mark.parametrize("model", SENSORS.values(), ids=SENSORS)
def test_a_sensor_agrees_with_its_profile(model):
    config = profile.load(model.name).sensor
    elevation_step_deg = np.rad2deg(-np.diff(model.elevation_rad).mean())
    azimuth_step_deg = np.rad2deg(np.diff(model.azimuth_rad).mean())
    assert config.elevation_step_deg == pytest.approx(elevation_step_deg, rel=0.02)
    assert config.azimuth_step_deg == pytest.approx(azimuth_step_deg, rel=0.02)
    assert config.period_s == model.period_s
    assert config.height_m == model.height_m
