import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from modt.config import SegmentationConfig, SensorConfig
from modt.segmentation.cells import connect, occupied_cells
from modt.segmentation.cluster_sizes import ClusterSizes, moved
from modt.segmentation.clustering import Clusterer
from modt.segmentation.grids import PointColumns, SqrtRangeGrid
from modt.segmentation.tuning import SegmentationTuning
from modt.types import NONE
from tests.segmentation import reference

STEP = 0.03
BEAM_RAD = 0.007


def cloud(seed, n, sigma):
    rng = np.random.default_rng(seed)
    centre = rng.uniform(-40, 40, (8, 2))
    points = np.zeros((n, 4), np.float32)
    points[:, :2] = centre[rng.integers(0, 8, n)] + rng.normal(0, sigma, (n, 2))
    points[:, 2] = rng.uniform(-1.5, 1.0, n)
    points = points[np.hypot(points[:, 0], points[:, 1]) > 1.0]
    return points[np.hypot(points[:, 0], points[:, 1]) < 79.0]


def cells_of(grid, points, height):
    cells, _, sampled, cell = occupied_cells(grid, points, height)
    return cells, cell, np.float32(BEAM_RAD) * np.square(sampled.sqrt_range)


def components(grid, cells, beam_m):
    gap_m = SegmentationTuning().cells.max_gap_m + SegmentationTuning().cells.max_gap_beams * beam_m
    return connect(grid, cells, gap_m, np.ones(len(cells), np.bool_))


@given(seed=st.integers(0, 10_000), n=st.integers(1, 400), sigma=st.floats(0.05, 3.0))
@settings(max_examples=60)
def test_components_are_those_of_a_flood_fill_and_lie_between_two_euclidean_radii(seed, n, sigma):
    """In the plane of the grid, points within one step share a cluster, and no cluster bridges two steps."""
    points, grid = PointColumns.from_array(cloud(seed, n, sigma)), SqrtRangeGrid(STEP, 80.0)
    if not len(points):
        return
    cells, _, beam_m = cells_of(grid, points, points.z + 1.7)
    assert reference.same_partition(components(grid, cells, beam_m), reference.flood_fill(cells, beam_m))
    cells, cell, beam_m = cells_of(grid, points, np.zeros(len(points), np.float32))
    fast = components(grid, cells, beam_m)[cell]
    plane = np.stack([points.x, points.y], axis=1).astype(np.float64) / points.sqrt_range[:, None]
    assert reference.refines(reference.within_distance(plane, STEP * 0.999), fast)
    assert reference.refines(fast, reference.within_distance(plane, 2 * STEP * 1.001))


@pytest.mark.parametrize("n", [1, 2, 7])
def test_points_of_no_height_are_no_cluster(n):
    points = np.tile(np.float32([[5.0, 1.0, -0.5]]), (n, 1))
    clusterer = Clusterer(SensorConfig(), SegmentationConfig())
    cells = clusterer.occupied_cells(PointColumns.from_array(points), np.full(n, 1.0, np.float32))
    assert clusterer.cluster(cells).n == 0


@given(seed=st.integers(0, 10_000), n=st.integers(1, 60))
def test_each_cluster_has_the_points_of_its_cells_after_parts_of_several_clusters_have_left(seed, n):
    """A cluster without cells that counted points would become a proposal without points, whose box is not finite."""
    rng = np.random.default_rng(seed)
    points = PointColumns.from_array(cloud(seed, 10 * n, 1.0))
    if not len(points):
        return
    cells, _, sampled, _ = occupied_cells(SqrtRangeGrid(STEP, 80.0), points, points.z + 1.7)
    beam_m = np.zeros(len(cells), np.float32)
    cluster = rng.integers(0, 4, len(cells))
    part = np.append(rng.integers(NONE, 4, len(cells) - 1), 0)
    sizes, parts = (ClusterSizes.of_cells(cells, sampled, beam_m, labels) for labels in (cluster, part))
    after, sizes_after = moved(cells, cluster, sizes, part, parts, rng.random(len(parts)) < 0.5)
    assert np.array_equal(sizes_after.points, np.bincount(after, cells.entries, len(sizes_after)))
