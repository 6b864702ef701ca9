import pytest
from hypothesis import given
from hypothesis import strategies as st

from modt.config import EnergyConfig
from modt.energy.attribution import attribute

from .simulated import CALIBRATED, line_of


@given(energy_J=st.floats(0, 20), frames=st.integers(0, 9), load=st.integers(0, 9))
def test_parts_sum_to_the_window(energy_J, frames, load):
    line = line_of(energy_J, frames, load)
    for board in (EnergyConfig(), CALIBRATED):
        assert sum(attribute(line, board).values()) == pytest.approx(energy_J)


def test_coefficients_split_the_reading_of_a_calibrated_board_but_not_the_model():
    parts = attribute(line_of(5.0, 2, 4), CALIBRATED)
    expected = {"idle": 3.0, "segmentation": 0.2, "classification": 0.04 + 0.036, "unattributed": 1.724}
    assert parts == pytest.approx(expected)
    estimated = line_of(5.0, 2, 4, kind="estimated")
    assert attribute(estimated, CALIBRATED) == attribute(estimated, EnergyConfig())
