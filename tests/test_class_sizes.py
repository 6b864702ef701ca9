"""Sizes of what may be a person."""

import numpy as np

from modt.class_sizes import PersonSize


def test_a_person_lies_within_every_bound():
    size = PersonSize(1.0, 0.5, min_top_m=1.0, max_top_m=2.2, min_extent_m=0.2)
    slim, wide, little_seen, low, tall = (
        (0.2, 0.0, 1.7),
        (1.0, 0.0, 1.7),
        (0.5, 1.2, 1.7),
        (0.5, 0.0, 1.0),
        (0.5, 0.0, 2.2),
    )
    fits = size.fits(*np.array([(0.5, 0.0, 1.7), slim, wide, little_seen, low, tall]).T)
    assert fits.tolist() == [True, False, False, False, False, False]
