"""Intensities are on the scale of their sensor."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from modt_desk.simulation.sensors import sensor


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
