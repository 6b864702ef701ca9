import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from modt.config import SegmentationConfig, SensorConfig
from modt.segmentation.clusters import Cells, Clusterer, join
from modt.segmentation.columns import Columns
from modt.segmentation.grids import RootGrid
from modt.types import NONE
from tests.segmentation import reference

STEP = 0.03
BEAM_RAD = 0.007


def cloud(seed, n, spread):
    rng = np.random.default_rng(seed)
    centre = rng.uniform(-40, 40, (8, 2))
    points = np.zeros((n, 4), np.float32)
    points[:, :2] = centre[rng.integers(0, 8, n)] + rng.normal(0, spread, (n, 2))
    points[:, 2] = rng.uniform(-1.5, 1.0, n)
    points = points[np.hypot(points[:, 0], points[:, 1]) > 1.0]
    return points[np.hypot(points[:, 0], points[:, 1]) < 79.0]


def cells_of(grid, points, height):
    row, column = grid.row_and_column(points)
    sample, cell = grid.occupy(grid.place(row, column))
    low = np.array([height[cell == i].min() for i in range(len(sample))], np.float32)
    high = np.array([height[cell == i].max() for i in range(len(sample))], np.float32)
    return Cells(row[sample], column[sample], low, high, points.root[sample]), cell


@given(seed=st.integers(0, 10_000), n=st.integers(1, 250), spread=st.floats(0.05, 3.0))
@settings(max_examples=60)
def test_cells_are_joined_as_a_flood_would_join_them(seed, n, spread):
    points = Columns.of(cloud(seed, n, spread))
    if not len(points):
        return
    grid = RootGrid(STEP, 80.0)
    cells, _ = cells_of(grid, points, points.z + 1.7)
    slow = reference.flood(cells.row, cells.column, cells.low, cells.high, cells.root, BEAM_RAD)
    assert reference.same_partition(join(grid, cells, BEAM_RAD), slow)


@given(seed=st.integers(0, 10_000), n=st.integers(1, 400), spread=st.floats(0.05, 3.0))
@settings(max_examples=60)
def test_the_grid_stays_between_two_euclidean_radii(seed, n, spread):
    """Points within one step of the drawn-in plane always share a cluster; clusters never bridge two steps."""
    points = Columns.of(cloud(seed, n, spread))
    if not len(points):
        return
    grid = RootGrid(STEP, 80.0)
    cells, cell = cells_of(grid, points, np.zeros(len(points), np.float32))
    fast = join(grid, cells, BEAM_RAD)[cell]
    plane = np.stack([points.x, points.y], axis=1).astype(np.float64) / points.root[:, None]
    assert reference.refines(reference.within_distance(plane, STEP * 0.999), fast)
    assert reference.refines(fast, reference.within_distance(plane, 2 * STEP * 1.001))


@given(seed=st.integers(0, 10_000), n=st.integers(1, 400))
def test_every_point_is_in_the_cell_of_its_place(seed, n):
    points = Columns.of(cloud(seed, n, 1.0))
    grid = RootGrid(STEP, 80.0)
    place = grid.place(*grid.row_and_column(points))
    sample, cell = grid.occupy(place)
    assert np.array_equal(place[sample][cell], place)
    assert len(np.unique(place)) == len(sample)
    assert (grid.occupy(place)[1] == cell).all(), "the grid is left as it was found"


def test_the_clustering_distance_grows_with_range():
    clusterer = Clusterer(SensorConfig(), SegmentationConfig(min_points=1, min_height_m=0.0))

    def parts(range_m, gap_m):
        y = np.repeat([-gap_m / 2, gap_m / 2], 10)
        points = np.stack([np.full(20, range_m), y, np.tile(np.linspace(-1.4, 0.0, 10), 2)], axis=1)
        return clusterer.cluster(Columns.of(points.astype(np.float32)), np.tile(np.linspace(0.3, 1.7, 10), 2)).n

    assert parts(5.0, 0.35) == 2
    assert parts(50.0, 0.2) == 1
    assert parts(50.0, 1.2) == 2


def test_what_hangs_high_above_joins_nothing():
    height = np.concatenate([np.linspace(0.3, 1.0, 30), np.linspace(2.0, 2.5, 30)]).astype(np.float32)
    points = np.stack([np.full(60, 8.0), np.zeros(60), height - 1.7], axis=1).astype(np.float32)
    points[30:, 1] += 0.2
    clusters = Clusterer(SensorConfig(), SegmentationConfig()).cluster(Columns.of(points), height)
    label = clusters.of_cell[clusters.cell]
    assert set(label[:30]).isdisjoint(label[30:])


def test_someone_close_to_a_long_wall_is_taken_from_it():
    rng = np.random.default_rng(0)
    wall = np.stack([np.full(6000, 12.0), rng.uniform(-10, 10, 6000), rng.uniform(-1.4, 0.8, 6000)], axis=1)
    person = rng.normal([11.55, 1.0, -0.7], [0.08, 0.12, 0.4], (200, 3))
    points = np.concatenate([wall, person]).astype(np.float32)
    height = points[:, 2] + np.float32(1.73)
    clusters = Clusterer(SensorConfig(), SegmentationConfig()).cluster(Columns.of(points), height)
    label = clusters.of_cell[clusters.cell]
    mine = np.bincount(label[6000:] + 1)
    assert mine.argmax() > 0
    assert mine.max() > 180
    assert (label[:6000] == mine.argmax() - 1).sum() < 20
    assert (label[:6000] == NONE).sum() > 5000, "the wall is too long to be an object"


@pytest.mark.parametrize("n", [1, 2, 7])
def test_a_few_points(n):
    points = np.tile(np.float32([[5.0, 1.0, -0.5]]), (n, 1))
    clusters = Clusterer(SensorConfig(), SegmentationConfig()).cluster(
        Columns.of(points), np.full(n, 1.0, np.float32)
    )
    assert clusters.n == 0  # no height of its own
