"""Intensities are on the scale of their sensor, and like those of a real HDL-64E."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from modt_desk.simulation.sensors import sensor
from modt_desk.simulation.synthetic_stream import SyntheticStream


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


def test_a_sweep_reports_0_to_0_99_with_more_zeros_at_range():
    frame, truth = next(SyntheticStream(seconds=0.1, seed=3).sweeps())
    value, away = frame.points[:, 3], np.linalg.norm(frame.points[:, :3], axis=1)
    assert value.min() == 0
    assert value.max() == np.float32(0.99)
    np.testing.assert_allclose(100 * value, np.rint(100 * value), atol=1e-4)
    scenery = np.isin(truth.semantic, (50, 70))
    dark = [
        (value[scenery & (away > a) & (away < b)] == 0).mean() for a, b in ((12, 20), (25, 35), (40, 50), (55, 70))
    ]
    assert dark == sorted(dark)
    assert dark[0] < 0.15 < 0.3 < dark[2] < 0.7 < dark[3]
