"""What hangs above people, and who leaves the cluster below it."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from modt.config import SegmentationConfig
from modt.segmentation.clustering import Clusterer
from modt.segmentation.grids import PointColumns
from modt.segmentation.kernels import NUMPY
from modt.segmentation.overhang import LEVELS_PER_M, N_LEVELS, levels_of, standing_top_m
from modt.segmentation.tuning import OverhangTuning
from modt.types import NONE
from tests.segmentation.test_structure import SENSOR, label

TUNING = OverhangTuning()


def disc(x, y, z, radius_m=1.2):
    """Points of something wide and flat, 0.1 m apart."""
    across = np.arange(-radius_m, radius_m, 0.1)
    off_x, off_y = np.meshgrid(across, across)
    inside = np.hypot(off_x, off_y) < radius_m
    return np.column_stack([x + off_x[inside], y + off_y[inside], np.full(np.count_nonzero(inside), z)])


def column(x, y, radius_m, top_m):
    """Points of the near side of something round and upright."""
    angle = np.linspace(-np.pi, 0, 40)
    ring = np.stack([x + radius_m * np.cos(angle), y + radius_m * np.sin(angle)], axis=1)
    return np.concatenate([np.column_stack([ring, np.full(len(ring), z)]) for z in np.arange(0.3, top_m, 0.1)])


def person(x, y):
    """Points of a person."""
    return column(x, y, 0.25, 1.7)


def one_cell(heights_m, beam_m=0.05):
    """Height up to which the points of a cell with these heights stand [m]."""
    heights = np.array(heights_m, np.float32)
    levels = np.bitwise_or.reduce(levels_of(heights), keepdims=True)
    place = np.zeros(1, np.int32)
    return standing_top_m(place, place, levels, heights.max(keepdims=True), np.array([beam_m], np.float32), TUNING)[0]


@given(st.lists(st.floats(-1.0, 4.0, width=32), min_size=1))
def test_a_level_holds_the_heights_of_a_tenth_of_a_metre(heights):
    levels = levels_of(np.array(heights, np.float32))
    for height, level in zip(heights, levels.tolist(), strict=True):
        number = level.bit_length() - 1
        assert level == 1 << number
        assert number == min(max(int(np.float32(height) * np.float32(LEVELS_PER_M)), 0), N_LEVELS - 1)


def test_points_stand_up_to_the_gap_below_what_hangs():
    person_m = np.arange(0.25, 1.75, 0.1)
    assert one_cell(person_m) == pytest.approx(person_m.max())
    assert one_cell([*person_m, 2.15, 2.25]) == pytest.approx(1.7, abs=0.11)
    assert one_cell([*person_m, 1.85, 1.95, 2.05]) == pytest.approx(2.05)  # no gap
    assert one_cell([2.15, 2.25]) == 0.0
    assert one_cell([0.25, 0.95, 1.75]) == pytest.approx(0.95, abs=0.11)


def test_a_gap_is_more_than_the_spacing_of_the_beams():
    assert one_cell([*np.arange(0.3, 1.7, 0.1), 2.1], beam_m=0.1) < 1.8
    assert one_cell([*np.arange(0.3, 1.7, 0.1), 2.1], beam_m=0.35) == pytest.approx(2.1)


def clustered(points):
    columns = PointColumns.from_array(points.astype(np.float32))
    clusterer = Clusterer(SENSOR, SegmentationConfig(), NUMPY)
    return clusterer.cluster(clusterer.occupied_cells(columns, columns.z))


def test_a_person_below_a_crown_leaves_it_and_the_trunk_does_not():
    parts = [person(0.3, 5.0), disc(0.0, 5.0, 2.2), column(-0.9, 5.6, 0.15, 2.3)]
    of_person, of_crown, of_trunk = np.split(
        label(clustered(np.concatenate(parts))), np.cumsum([len(part) for part in parts])[:-1]
    )
    assert len(set(of_person)) == 1
    assert of_person[0] != NONE
    assert not np.isin(of_person[0], [*of_crown, *of_trunk])


@pytest.mark.parametrize("seed", range(10))
def test_a_van_that_few_returns_meet_is_not_divided(seed):
    x, z = np.meshgrid(np.arange(-2.5, 2.5, 0.02), np.arange(0.3, 2.2, 0.1))
    side = np.column_stack([x.ravel(), np.full(x.size, 6.0), z.ravel()])
    few = side[np.random.default_rng(seed).random(len(side)) < 0.2]
    assert set(label(clustered(few))) == {0}
