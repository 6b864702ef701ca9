"""The leave-one-out study."""

import numpy as np
import pytest

from modt.profile import load
from tools.study.leave_one_out import FIGURES, interval, table
from tools.study.mechanisms import MECHANISMS


@pytest.mark.parametrize("name", MECHANISMS)
def test_every_switch_changes_the_profile_within_the_bounds_of_the_configuration(name):
    profile = load("hdl-64e")
    assert MECHANISMS[name][1](profile) != profile


def test_interval_of_equal_differences_is_a_point_and_drives_without_a_figure_are_left_out():
    assert interval(np.array([2.0, np.nan, 2.0])) == (2.0, 2.0, 2.0)
    mean, low, high = interval(np.array([-1.0, 0.0, 4.0]))
    assert low < mean == 1.0 < high
    assert np.isnan(interval(np.array([np.nan]))).all()


def test_table_marks_what_lies_beyond_its_interval():
    differences = np.zeros((3, 1, len(FIGURES)))
    differences[:, 0, 0], differences[:, 0, 1] = (-1, -2, -3), (-1, 0, 1)
    row = table(["landmarks"], differences).splitlines()[2].split(" | ")
    assert row[2].startswith("**-2.00 (")
    assert row[3].startswith("+0.00 (")
