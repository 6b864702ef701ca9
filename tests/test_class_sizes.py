"""Sizes of what may be a person."""

import numpy as np
import pytest

from modt.class_sizes import PersonSize


@pytest.mark.parametrize(
    ("extent_m", "bottom_m", "top_m", "fits"),
    [
        (0.5, 0.0, 1.7, True),
        (0.2, 0.0, 1.7, False),
        (1.0, 0.0, 1.7, False),
        (0.5, 1.2, 1.7, False),
        (0.5, 0.0, 1.0, False),
        (0.5, 0.0, 2.2, False),
    ],
    ids=["person", "too slim", "too wide", "too little seen", "too low", "too tall"],
)
def test_a_person_lies_within_every_bound(extent_m, bottom_m, top_m, fits):
    size = PersonSize(1.0, 0.5, min_top_m=1.0, max_top_m=2.2, min_extent_m=0.2)
    assert size.fits(*np.array([[extent_m], [bottom_m], [top_m]])).tolist() == [fits]
