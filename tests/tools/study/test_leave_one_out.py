"""The leave-one-out study."""

import numpy as np
import pytest

from modt.profile import load
from tools.study.leave_one_out import FIGURES, interval, run, simulated, study, table
from tools.study.mechanisms import MECHANISMS, PAIRS


@pytest.mark.parametrize("name", MECHANISMS)
def test_every_switch_changes_the_profile_within_the_bounds_of_the_configuration(name):
    profile = load("hdl-64e")
    assert MECHANISMS[name][1](profile) != profile


def test_a_pair_is_both_of_its_switches():
    profile = load("hdl-64e")
    names = PAIRS[0]
    expected = MECHANISMS[names[1]][1](MECHANISMS[names[0]][1](profile))
    assert MECHANISMS[" + ".join(names)][1](profile) == expected


def test_interval_of_equal_differences_is_a_point_and_drives_without_a_figure_are_left_out():
    assert interval(np.array([2.0, np.nan, 2.0])) == (2.0, 2.0, 2.0)
    mean, low, high = interval(np.array([-1.0, 0.0, 4.0]))
    assert low < mean == 1.0 < high
    assert np.isnan(interval(np.array([np.nan]))).all()


def test_table_marks_what_lies_beyond_its_interval():
    differences = np.zeros((3, 1, len(FIGURES)))
    differences[:, 0, 0], differences[:, 0, 1] = (-1, -2, -3), (-1, 0, 1)
    row = table(["StripMerger"], differences).splitlines()[2].split(" | ")
    assert row[2].startswith("**-2.00 (")
    assert row[3].startswith("+0.00 (")


@pytest.mark.slow
def test_mechanisms_earn_figures_on_a_simulated_drive():
    drive = simulated("street", "vlp-16", 2.0, 300)
    figures = dict(zip(FIGURES, run(drive, "accurate"), strict=True))
    assert all(0 < figures[name] <= 100 for name in ("recall", "said", "precision", "AP", "life"))
    merger, reunion = study(drive, "accurate", ["StripMerger", "Reunion"])
    assert merger[FIGURES.index("recall")] < 0
    assert abs(reunion[FIGURES.index("recall")]) < 1  # tracking changes no segment that it does not regroup
    assert reunion[FIGURES.index("breaks")] > 0
