"""Counting of the motion witness's table."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from tools.study.drives import simulated
from tools.train.motion_witness import CELLS, FRAGMENTS, MOST, WEIGHT, counted, log_likelihood_ratio


def test_ratio_of_frequent_cells_is_that_of_the_counts():
    counts = np.full((4, CELLS, 4), 100_000)
    counts[:, 0, 2] *= 3
    ratio = log_likelihood_ratio(counts)
    assert_allclose(ratio[:, 1, 0], WEIGHT * np.log(3 / (CELLS + 2) * CELLS), atol=1e-3)
    assert_allclose(ratio[:, 0], 0.0, atol=1e-3)


def test_an_object_that_is_hardly_ever_so_short_is_none_there():
    counts = np.full((4, CELLS, 4), 100_000)
    counts[FRAGMENTS, :, 2] = 0
    ratio = log_likelihood_ratio(counts)
    assert (ratio[FRAGMENTS, 1] == -MOST).all()
    assert_allclose(ratio[FRAGMENTS, 0], 0.0, atol=1e-3)


@pytest.mark.slow
def test_every_judged_track_of_a_drive_is_counted_once():
    counts = counted(simulated("crossing", "vlp-16", 0.5, 900), 0)
    assert counts[:, 3:].sum() < counts.sum()  # hardly anything has gone far within half a second
    assert counts[..., 0].sum() > counts[..., 1:].sum() > 0
