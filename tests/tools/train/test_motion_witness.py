"""Counting of the motion witness's table."""

import numpy as np

from tools.study.drives import simulated
from tools.train.motion_witness import CELLS, MOST, WEIGHT, counted, log_likelihood_ratio


def test_ratio_of_frequent_cells_is_that_of_the_counts():
    counts = np.full((3, CELLS, 4), 100_000)
    counts[:, 0, 2] *= 3
    ratio = log_likelihood_ratio(counts)
    expected = WEIGHT * np.log(3 / (CELLS + 2) * CELLS)
    np.testing.assert_allclose(ratio[:, 1, 0], expected, atol=1e-3)
    np.testing.assert_allclose(ratio[:, 0], 0.0, atol=1e-3)


def test_a_length_without_counts_has_those_of_all_lengths_and_no_certainty():
    counts = np.zeros((3, CELLS, 4), np.int64)
    counts[0, 1, 0] = counts[0, 2, 1] = 1000
    ratio = log_likelihood_ratio(counts)
    assert np.abs(ratio).max() <= MOST
    np.testing.assert_allclose(ratio[1], ratio[2])
    assert ratio[1, 0, 2] == MOST


def test_every_judged_track_of_a_drive_is_counted_once():
    counts = counted(simulated("crossing", "vlp-16", 0.5, 900), 0)
    assert counts[:, 3:].sum() < counts.sum()  # hardly anything has gone far within half a second
    assert counts[..., 0].sum() > counts[..., 1:].sum() > 0
