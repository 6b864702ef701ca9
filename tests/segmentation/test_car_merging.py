from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from modt.config import SegmentationConfig, SensorConfig
from modt.segmentation.cluster_sizes import ClusterSizes
from modt.segmentation.clustering import Clusterer
from modt.segmentation.grids import PointColumns
from modt.segmentation.groups import Groups
from modt.segmentation.strips import ViewBounds, merge_strips
from modt.segmentation.tuning import SegmentationTuning, StripTuning
from tests.segmentation import reference, scans

BEAM = np.tan(np.deg2rad(SensorConfig().elevation_step_deg))
PERSON = (0.35, 0.5, 0.0, 1.75)
HEAD_AND_SHOULDERS = (0.35, 0.5, 1.1, 1.75)


def strips(rng, n):
    """Bounds of n strips around the sensor, some of them one above and behind the other."""
    points, low, high, group = [], [], [], []
    for i in range(n):
        if i % 3 == 0:
            bearing, away, bottom = rng.uniform(-np.pi, np.pi), rng.uniform(20.0, 70.0), rng.uniform(0.25, 0.9)
        else:
            away, bottom = away + rng.uniform(-0.2, 2.2), bottom + rng.uniform(-0.1, 0.8)
        k = rng.integers(2, 12)
        across = rng.uniform(-0.5, 0.5) + rng.uniform(0.0, rng.choice([0.5, 1.8, 5.0]), k)
        along = away + rng.uniform(0.0, rng.choice([0.2, 1.5]), k)
        c, s = np.cos(bearing), np.sin(bearing)
        points.append(np.stack([along * c - across * s, along * s + across * c, 0 * along], axis=1))
        low.append(np.full(k, bottom))
        high.append(bottom + rng.uniform(0.0, rng.choice([0.3, 1.5]), k))
        group.append(np.full(k, i))
    order = rng.permutation(sum(len(p) for p in points))
    cells = PointColumns.from_array(np.concatenate(points)[order].astype(np.float32))
    low, high = (np.concatenate(v)[order].astype(np.float32) for v in (low, high))
    ground = np.full(len(order), -1.73, np.float32)
    groups = Groups.from_labels(np.concatenate(group)[order], n)
    rows = groups.rows
    return ViewBounds.of_cells(cells.take(rows), ground, low[rows], high[rows], groups)


@given(seed=st.integers(0, 10_000), n=st.integers(1, 24), limit_m=st.sampled_from([2.0, 6.0]))
@settings(max_examples=80)
def test_targets_equal_those_of_pairs_one_by_one(seed, n, limit_m):
    """The random strips make pairs and chains, some of them longer than the lowest limit."""
    bounds, limits = strips(np.random.default_rng(seed), n), StripTuning(max_diagonal_m=limit_m)
    found = merge_strips(bounds, np.full(n, BEAM, np.float32), limits)
    np.testing.assert_array_equal(found, reference.car_targets(bounds, BEAM, limits))


@given(bearing=st.floats(-1.4, 4.5), range_m=st.floats(20.0, 70.0), width_m=st.floats(0.3, 5.0))
def test_bounds_are_in_metres(bearing, range_m, width_m):
    angle = bearing + np.linspace(-0.5, 0.5, 9) * width_m / range_m
    xyz = range_m * np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1)
    low, high, ground = (np.linspace(*ends, 9, dtype=np.float32) for ends in ((0.3, 0.5), (1.2, 1.0), (-1.5, -1.5)))
    one_group = Groups(np.arange(9), np.array([0, 9]))
    bounds = ViewBounds.of_cells(PointColumns.from_array(xyz.astype(np.float32)), ground, low, high, one_group)
    assert bounds.width_m[0] == pytest.approx(width_m, rel=width_m / range_m, abs=0.02)
    assert bounds.min[1:, 0] == pytest.approx([range_m, 0.3, -1.2 / range_m], rel=1e-4)
    assert bounds.max[1:, 0] == pytest.approx([range_m, 1.2, -0.3 / range_m], rel=1e-4)


UNMERGED = replace(SegmentationTuning(), strips=StripTuning(max_diagonal_m=0.0))


@pytest.mark.parametrize(("x", "y"), [(28.0, 0.0), (34.0, -9.0), (40.0, 6.0)])
def test_rear_and_roof_are_one_car(x, y):
    apart = 0
    for seed in range(6):
        rear_m = x + 0.3 * seed
        car = [(rear_m, y, 0.4, 1.7, 0.3, 0.9), (rear_m + 2.2, y, 1.6, 1.5, 0.8, 1.5)]
        apart += all(min(own) == 0 for own in scans.points_by_box(car, seed, tuning=UNMERGED))
        found = scans.points_by_box(car, seed)
        largest = max(found, key=sum)
        assert min(largest) > 0
        assert sum(largest) > 0.9 * sum(map(sum, found))
    assert apart > 0


@pytest.mark.parametrize(
    "pair",
    [
        [(30.0, 0.0, 4.2, 1.8, 0.2, 1.2), (33.6, 0.2, *PERSON)],  # a person behind a car
        [(17.0, 0.0, 0.5, 1.2, 0.0, 1.1), (18.4, 0.1, *HEAD_AND_SHOULDERS)],  # behind a crate
        [(30.0, 0.0, 0.4, 0.4, 0.0, 1.1), (31.5, 0.2, *PERSON)],  # a person behind a bollard
        [(30.0, 0.0, *PERSON), (31.5, 0.3, *PERSON)],
        [(30.0, 0.0, 4.2, 1.8, 0.2, 1.4), (36.0, 0.0, 4.2, 1.8, 0.2, 1.9)],  # nose to tail, the second a van
        [(30.0, 0.0, 4.2, 1.8, 0.2, 1.2), (34.0, 0.0, 0.3, 12.0, 0.0, 2.5)],  # a car before a wall
        [(35.0, 0.0, 0.4, 1.7, 0.3, 0.9), (37.0, 2.5, 1.6, 1.5, 0.95, 1.5)],  # side by side
    ],
)
def test_two_objects_stay_two(pair):
    for seed in range(4):
        moved = [(x, y + 0.05 * seed, *rest) for x, y, *rest in pair]
        assert all(min(own) == 0 for own in scans.points_by_box(moved, seed))


def test_near_clusters_are_not_merged():
    size, points = np.ones(3, np.float32), np.full(3, 50.0)
    range_m = np.array([10.0, 24.0, 27.0], np.float32)
    beam_m = range_m * np.float32(BEAM)
    sizes = ClusterSizes(points, np.arange(3), size, 0 * size, size, np.sqrt(range_m), beam_m, np.zeros(3, np.bool_))
    assert Clusterer(SensorConfig(), SegmentationConfig()).may_be_strips(sizes).tolist() == [False, False, True]
