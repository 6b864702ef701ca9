import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from modt.config import SegmentationConfig, SensorConfig
from modt.segmentation.columns import Columns
from modt.segmentation.grids import SECTORS, PolarGrid, pseudo_angle
from modt.segmentation.ground import Ground
from modt.segmentation.sensor_height import USUAL_M, EstimatedHeight, sensor_height
from tests.segmentation import reference, scans

HEIGHT_M = 1.73
PROFILES = {
    "flat": lambda x, y: np.full_like(x, -HEIGHT_M),
    "tilted sensor": lambda x, y: -HEIGHT_M + 0.1 * x,
    "ramp up": lambda x, y: -HEIGHT_M + 0.12 * np.clip(x - 8, 0, 25),
    "ramp down": lambda x, y: -HEIGHT_M - 0.1 * np.clip(x - 8, 0, 25),
    "rolling": lambda x, y: -HEIGHT_M + 0.6 * (1 - np.cos(x / 10)),
    "cambered": lambda x, y: -HEIGHT_M - 0.03 * np.abs(y),
}


def ground(**sensor):
    return Ground(SensorConfig(**sensor), SegmentationConfig())


@pytest.mark.parametrize("name", PROFILES)
def test_ground_is_followed_over(name):
    direction = scans.rays(step_deg=1.0)
    hit = scans.floor_ranges(direction, PROFILES[name])
    seen = np.isfinite(hit)
    points = (direction[seen] * hit[seen, None]).astype(np.float32)
    height = ground().height(Columns.of(points), HEIGHT_M)
    assert (np.abs(height) < 0.25).mean() > 0.97


def test_a_kerb_belongs_to_the_ground_and_a_wall_does_not():
    points, on = scans.scan([(20.0, 8.0, 50.0, 4.0, 0.0, 0.12), (20.0, 12.0, 50.0, 1.0, 0.0, 2.0)], step_deg=0.5)
    height = ground().height(Columns.of(points), HEIGHT_M)
    assert (height[on == 0] < 0.15).mean() > 0.99
    assert (height[on == 1] < 0.25).mean() > 0.95
    wall = (on == 2) & (points[:, 2] > -HEIGHT_M + 0.5)
    assert (height[wall] > 0.25).mean() > 0.97


def test_objects_stand_at_their_height():
    points, on = scans.scan([(15.0, 0.0, 4.0, 1.8, 0.0, 1.5), (25.0, 6.0, 0.5, 0.5, 0.0, 1.7)])
    height = ground().height(Columns.of(points), HEIGHT_M)
    assert np.allclose(height[on > 0], points[on > 0, 2] + HEIGHT_M, atol=0.15)


def test_reflections_below_the_ground_do_not_lower_it():
    points, _ = scans.scan()
    rng = np.random.default_rng(3)
    row = rng.choice(len(points), 300, replace=False)
    points[row, 2] -= rng.uniform(0.5, 3.0, 300).astype(np.float32)
    kept = np.setdiff1d(np.arange(len(points)), row)
    height = ground().height(Columns.of(points), HEIGHT_M)
    assert (np.abs(height[kept]) < 0.15).mean() > 0.99


def test_a_road_that_climbs_goes_on_beyond_the_last_return_of_it():
    direction = scans.rays(step_deg=1.0)
    hit = scans.floor_ranges(direction, PROFILES["ramp up"])
    near = hit < 24.0
    road = (direction[near] * hit[near, None]).astype(np.float32)
    far = np.array([[44.0, y, z - HEIGHT_M + 0.12 * 25] for y in np.arange(-3.0, 3.1, 0.5) for z in (0.5, 1.5)])
    height = ground().height(Columns.of(np.concatenate([road, far.astype(np.float32)])), HEIGHT_M)
    assert np.allclose(height[: len(road)], 0.0, atol=0.3)
    assert np.allclose(height[len(road) :], far[:, 2] + HEIGHT_M - 0.12 * 25, atol=0.7)


@pytest.mark.parametrize(("x", "y", "broad"), [(53.0, 1.0, 3.0), (50.0, 12.0, 3.0), (47.0, 20.0, 4.6)])
def test_the_flank_of_a_far_car_is_no_ground(x, y, broad):
    points, on = scans.scan([(x, y, 1.8, broad, 0.3, 1.6)], step_deg=0.17, azimuth_deg=(-60, 60))
    height = ground().height(Columns.of(points), HEIGHT_M)
    assert np.allclose(height[on == 1], points[on == 1, 2] + HEIGHT_M, atol=0.1)


def test_a_small_robot_sees_its_floor():
    points, on = scans.scan(
        [(3.0, 0.0, 0.4, 0.4, 0.0, 1.7), (0.0, 4.0, 8.0, 0.2, 0.0, 2.5)], 0.3, np.deg2rad(np.linspace(-25, 15, 32))
    )
    near = SensorConfig(height_m=0.3, min_range_m=0.3, max_range_m=30.0)
    height = Ground(near, SegmentationConfig()).height(Columns.of(points), 0.3)
    assert (np.abs(height[on == 0]) < 0.1).mean() > 0.98
    assert np.allclose(height[on > 0], points[on > 0, 2] + 0.3, atol=0.1)


def test_the_order_of_the_points_does_not_matter():
    points, _ = scans.scan([(15.0, 0.0, 4.0, 1.8, 0.0, 1.5)])
    order = np.random.default_rng(1).permutation(len(points))
    straight = ground().height(Columns.of(points), HEIGHT_M)
    assert np.array_equal(ground().height(Columns.of(points[order]), HEIGHT_M), straight[order])


@given(seed=st.integers(0, 1000))
@settings(max_examples=8)
def test_rays_are_followed_as_a_loop_would(seed):
    rng = np.random.default_rng(seed)
    fast = ground()
    lowest = rng.normal(-HEIGHT_M, 0.25, (fast.grid.rings, SECTORS)).astype(np.float32)
    lowest[rng.random(lowest.shape) < 0.3] = np.inf
    slow, slow_slope = reference.supported(lowest, fast.grid.range_m.astype(float), HEIGHT_M, fast.max_slope)
    supported, slope = fast._follow(lowest, HEIGHT_M)
    assert (supported == slow).mean() > 0.999  # float32 against float64 at the bound
    alike = (supported == slow).all(axis=0)
    assert slope[0, alike] == pytest.approx(slow_slope[0, alike], abs=1e-4)


@given(angle=st.floats(-3.14, 3.14), other=st.floats(-3.14, 3.14))
def test_the_pseudo_angle_grows_with_the_angle(angle, other):
    a, b = np.sort(np.array([angle, other])) % (2 * np.pi)
    low, high = min(a, b), max(a, b)
    values = pseudo_angle(*(f(np.array([low, high]) - np.pi / 2).astype(np.float32) for f in (np.cos, np.sin)))
    assert values[0] <= values[1] + 1e-4
    assert (values >= 0).all()
    assert (values <= 4).all()


def test_cells_of_the_polar_grid_are_inside_it():
    rng = np.random.default_rng(0)
    points = Columns.of(rng.normal(0, 60, (5000, 4)).astype(np.float32))
    grid = PolarGrid(80.0)
    cell = grid.cell(points)
    assert cell.min() >= 0
    assert cell.max() < grid.size


@pytest.mark.parametrize("true_m", [0.3, 0.8, 1.73, 2.5])
def test_the_height_of_the_sensor_is_found(true_m):
    points, _ = scans.scan([(6.0, 3.0, 4.0, 1.8, 0.0, 1.5), (0.0, -8.0, 30.0, 0.5, 0.0, 3.0)], true_m, step_deg=1.0)
    height = EstimatedHeight(SensorConfig(height_m=None, min_range_m=0.5))
    assert height.of(Columns.of(points)) == pytest.approx(true_m, abs=0.05)


def test_walls_alone_are_no_floor():
    walls = [
        (x, y, *((3.0, 0.2) if y else (0.2, 3.0)), -1.0, 3.0) for x, y in [(1.2, 0), (-1.4, 0), (0, 1.3), (0, -1.5)]
    ]
    points, on = scans.scan(walls, 0.8, scans.VLP_16, step_deg=0.2)
    assert (on > 0).all()
    sensor = SensorConfig(height_m=None, min_range_m=0.4, elevation_step_deg=2.0)
    assert EstimatedHeight(sensor).of(Columns.of(points)) == USUAL_M


def test_a_floor_is_found_between_walls_that_hide_most_of_it():
    walls = [
        (x, y, *((4.0, 0.2) if y else (0.2, 4.0)), 0.0, 3.0) for x, y in [(1.9, 0), (-1.7, 0), (0, 1.8), (0, -2.0)]
    ]
    points, on = scans.scan(walls, 0.36, scans.VLP_16, step_deg=0.2)
    assert 0.05 < (on == 0).mean() < 0.2
    sensor = SensorConfig(height_m=None, min_range_m=0.4, elevation_step_deg=2.0)
    assert EstimatedHeight(sensor).of(Columns.of(points)) == pytest.approx(0.36, abs=0.03)


def test_no_floor_leaves_the_usual_height():
    height = sensor_height(SensorConfig(height_m=None))
    assert height.of(Columns.of(np.zeros((0, 4), np.float32))) == USUAL_M
    assert height.of(Columns.of(np.float32([[5, 0, -1, 0]]))) == USUAL_M


def test_a_given_height_is_kept():
    assert sensor_height(SensorConfig(height_m=0.5)).of(Columns.of(np.zeros((0, 4), np.float32))) == 0.5
