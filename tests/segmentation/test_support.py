"""What proposals stand on."""

import numpy as np
import pytest

from modt.segmentation.support import support_z_m
from modt.segmentation.tuning import SupportTuning

TUNING = SupportTuning()
GROUND_Z_M = -0.8
PERSON = (0.5, 0.4, 1.7)
POINTS = 60


def support_m(bottom_m, size, count=POINTS):
    """Height above the ground of what a proposal stands on, by its lowest point, its size and points."""
    length, width, height = size
    box = np.array([[6.0, 1.0, GROUND_Z_M + bottom_m + height / 2, length, width, height, 0.3]])
    return support_z_m(np.array([GROUND_Z_M]), box, np.array([count]), TUNING)[0] - GROUND_Z_M


@pytest.mark.parametrize("platform_m", [0.4, 0.5, 0.7])
def test_a_person_on_a_platform_stands_on_it(platform_m):
    assert support_m(platform_m, PERSON) == pytest.approx(platform_m)


@pytest.mark.parametrize(
    ("bottom_m", "size", "count"),
    [
        (0.05, PERSON, POINTS),  # on the ground
        (0.9, (0.5, 0.4, 0.8), POINTS),  # head and shoulders behind a counter
        (0.6, (1.8, 0.4, 1.7), POINTS),  # too wide: a canopy
        (1.6, PERSON, POINTS),  # too high: a sign
        (0.9, PERSON, POINTS),  # as high as a part of a tree
        (0.6, PERSON, TUNING.min_points - 1),
    ],
)
def test_all_else_stands_on_the_ground(bottom_m, size, count):
    assert support_m(bottom_m, size, count) == 0.0
