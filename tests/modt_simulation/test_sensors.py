"""The sensor table against the profiles of the same names."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from modt import profile
from modt_simulation.sensors import SENSORS, sensor


@pytest.mark.parametrize("model", SENSORS.values(), ids=SENSORS)
def test_a_sensor_agrees_with_its_profile(model):
    config = profile.load(model.name).sensor
    elevation_deg = np.rad2deg(model.elevation_rad)
    span_deg = np.ptp(elevation_deg)
    around_deg = len(model.azimuth_rad) * np.rad2deg(np.ptp(model.azimuth_rad[:2]))
    if config.elevations_deg is not None:
        assert np.sort(config.elevations_deg) == pytest.approx(elevation_deg[::-1])
    elif model.sweeps_a_ray == 1:
        assert config.elevation_step_deg == pytest.approx(span_deg / (model.shape[0] - 1), rel=0.02)
    if model.sweeps_a_ray == 1:
        assert config.azimuth_step_deg == pytest.approx(around_deg / model.shape[1], rel=0.02)
    else:
        fired = model.fires(*np.indices(model.shape).reshape(2, -1), 0)
        spacing_deg = np.sqrt(span_deg * around_deg / fired.sum())
        assert config.elevation_step_deg == config.azimuth_step_deg == pytest.approx(spacing_deg, rel=0.02)
    assert config.period_s == model.period_s
    assert config.height_m == model.height_m


def test_a_non_repetitive_sensor_fires_other_rays_in_every_sweep():
    model = sensor("mid-360")
    row, column = np.indices(model.shape).reshape(2, -1)
    sweeps = [model.fires(row, column, k).reshape(model.shape) for k in range(6)]
    for fired in sweeps:
        assert fired.sum() == pytest.approx(20_000, rel=0.01)
        assert np.ptp(fired.sum(axis=0)) <= 1
    assert (sweeps[0] & sweeps[1]).sum() < 0.1 * sweeps[0].sum()
    assert np.logical_or.reduce(sweeps).sum() > 4.5 * sweeps[0].sum()


@given(
    st.lists(st.floats(-1, 3, width=32), min_size=2, max_size=20),
    st.floats(1, 120, width=32),
    st.sampled_from(["hdl-64e", "vlp-16"]),
)
def test_reported_intensities_are_steps_of_the_scale_and_increase(intensity, slant_m, name):
    response = sensor(name).response
    got = response.report(np.sort(np.array(intensity, np.float32)), np.full(len(intensity), slant_m, np.float32))
    assert 0 <= got.min() <= got.max() <= np.float32(response.most)
    np.testing.assert_allclose(got, np.rint(got * response.steps) / response.steps, atol=1e-6)
    assert (np.diff(got) >= 0).all()
