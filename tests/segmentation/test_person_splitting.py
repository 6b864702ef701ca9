"""People split off what they are clustered with, on the fine grid."""

from dataclasses import replace

import numpy as np
import pytest

from modt.segmentation.tuning import SegmentationTuning, SplitTuning
from tests.segmentation import scans

PERSON = (0.35, 0.5, 0.0, 1.75)
CAR = (4.2, 1.8, 0.2, 1.5)


WHOLE = replace(SegmentationTuning(), split=SplitTuning(min_extent_m=10.0))
"""No cluster is divided."""
FINER = replace(SegmentationTuning(), split=SplitTuning(min_cell_returns=0.1))
"""Clusters are divided where the returns lie far apart, too."""


@pytest.mark.parametrize(("range_m", "gap_m"), [(8.0, 0.15), (12.0, 0.2), (16.0, 0.25)])
def test_two_people_close_together_are_two(range_m, gap_m):
    together = False
    for seed, aside in enumerate(np.linspace(-1.0, 1.0, 12)):
        pair = [(range_m, aside, *PERSON), (range_m, aside + 0.5 + gap_m, *PERSON)]
        together = together or len(scans.points_by_box(pair, seed=seed, tuning=WHOLE)) == 1
        found = scans.points_by_box(pair, seed=seed)
        assert all(min(own) == 0 for own in found)
        assert np.max(found, axis=0).min() > 0.8 * np.sum(found, axis=0).min()
    assert together, "without splitting they are one"


@pytest.mark.parametrize(
    "thing",
    [
        (12.75, 0.9, 0.6, 1.4, 0.0, 1.6),  # a bush
        (12.0, 2.5, 1.8, 4.2, 0.2, 1.5),  # a car
        (12.0, 3.9, 0.4, 7.0, 0.0, 2.0),  # a hedge
    ],
)
def test_a_person_beside_something_is_split_off_it(thing):
    gap_m = 0.3
    _, aside, _, breadth, *_ = thing
    person = (12.0, aside - breadth / 2 - gap_m - 0.25, *PERSON)
    found = scans.points_by_box([person, thing])
    mine = max(found, key=lambda own: own[0])
    assert mine[1] == 0
    assert mine[0] > 100


@pytest.mark.parametrize(
    "thing",
    [
        (10.0, 0.0, 1.0, 2.4, 0.0, 1.7),  # a hedge
        (8.0, 1.0, 0.15, 0.15, 0.0, 2.4),  # a pole
        (14.0, 0.0, 0.4, 1.7, 0.0, 1.6),  # a cyclist from the side
        (9.0, 0.0, *PERSON),
    ],
)
def test_one_object_is_not_split(thing):
    for seed in range(4):
        x, y, *rest = thing
        for tuning in (SegmentationTuning(), WHOLE):
            assert len(scans.points_by_box([(x, y + 0.03 * seed, *rest)], seed, tuning=tuning)) == 1


def test_beyond_the_range_at_which_the_fine_grid_resolves_returns_nothing_is_split():
    """On a grid finer than the spacing of its returns a car would fall to pieces."""
    for seed in range(6):
        shipped, whole, finer = (
            len(scans.points_by_box([(35.0, 4.0, *CAR)], seed, 0.35, tuning))
            for tuning in (SegmentationTuning(), WHOLE, FINER)
        )
        assert shipped == whole <= finer
