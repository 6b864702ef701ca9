import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from modt.config import SegmentationConfig, SensorConfig
from modt.segmentation.grids import SECTORS, PointColumns, PolarGrid, pseudo_angle
from modt.segmentation.ground import DEFAULT_HEIGHT_M, GroundEstimator, HeightEstimator
from tests.segmentation import reference, scans

HEIGHT_M = 1.73
MAX_SLOPE_DEG = SegmentationConfig().max_slope_deg
NO_POINTS = PointColumns.from_array(np.zeros((0, 4), np.float32))
PROFILES = {
    "flat": lambda x, y: np.full_like(x, -HEIGHT_M),
    "tilted sensor": lambda x, y: -HEIGHT_M + 0.1 * x,
    "ramp up": lambda x, y: -HEIGHT_M + 0.12 * np.clip(x - 8, 0, 25),
    "ramp down": lambda x, y: -HEIGHT_M - 0.1 * np.clip(x - 8, 0, 25),
    "steep ramp up": lambda x, y: -HEIGHT_M + 0.268 * np.clip(x - 5, 0, 10),
    "steep ramp down": lambda x, y: -HEIGHT_M - 0.268 * np.clip(x - 5, 0, 10),
    "rolling": lambda x, y: -HEIGHT_M + 0.6 * (1 - np.cos(x / 10)),
    "cambered": lambda x, y: -HEIGHT_M - 0.03 * np.abs(y),
}


def ground(**sensor):
    return GroundEstimator(SensorConfig(**sensor), MAX_SLOPE_DEG)


@pytest.mark.parametrize("name", PROFILES)
def test_ground_of_each_profile_is_found(name):
    direction = scans.rays(step_deg=1.0)
    hit = scans.floor_ranges(direction, PROFILES[name])
    seen = np.isfinite(hit)
    points = (direction[seen] * hit[seen, None]).astype(np.float32)
    height = ground().height_above(PointColumns.from_array(points), HEIGHT_M)
    assert (np.abs(height) < 0.25).mean() > 0.97


@pytest.mark.parametrize(("max_slope_deg", "is_ground"), [(6.0, False), (14.0, True), (20.0, True)])
def test_the_steepest_ground_is_a_key(max_slope_deg, is_ground):
    direction = scans.rays(step_deg=1.0)
    hit = scans.floor_ranges(direction, lambda x, y: -HEIGHT_M + np.tan(np.deg2rad(13)) * np.clip(x - 5, 0, 10))
    seen = np.isfinite(hit)
    points = (direction[seen] * hit[seen, None]).astype(np.float32)
    height = GroundEstimator(SensorConfig(), max_slope_deg).height_above(PointColumns.from_array(points), HEIGHT_M)
    on_ramp = points[:, 0] > 7
    assert ((np.abs(height[on_ramp]) < 0.25).mean() > 0.95) == is_ground


def test_heights_of_people_on_a_ramp_are_above_the_ramp():
    slope = 0.268
    direction = scans.rays(scans.VLP_16, step_deg=0.2)
    hit = scans.floor_ranges(direction, lambda x, y: -0.8 + slope * np.clip(x - 4, 0, 10))
    person = scans.box_ranges(direction, (8.75, -0.25, -0.8 + 4.75 * slope), (9.25, 0.25, 2.2))
    points = (direction * np.minimum(hit, person)[:, None])[np.isfinite(np.minimum(hit, person))].astype(np.float32)
    on = (person < hit)[np.isfinite(np.minimum(hit, person))]
    height = ground(height_m=0.8, min_range_m=0.4).height_above(PointColumns.from_array(points), 0.8)
    assert on.sum() > 50
    assert np.allclose(height[on], points[on, 2] + 0.8 - 5 * slope, atol=0.25)


def test_the_ground_behind_a_person_on_a_ramp_is_that_beside_them():
    slope, direction = 0.268, scans.rays(np.deg2rad(np.linspace(-22.5, 22.5, 64)), step_deg=0.35)
    hit = scans.floor_ranges(direction, lambda x, y: -0.5 + slope * np.clip(x - 4, 0, 10))
    person = scans.box_ranges(direction, (10.75, -0.3, -0.5 + 6.75 * slope), (11.25, 0.3, -0.5 + 7 * slope + 1.7))
    nearest = np.minimum(hit, person)
    points = (direction * nearest[:, None])[np.isfinite(nearest)].astype(np.float32)
    on = (person < hit)[np.isfinite(nearest)]
    height = ground(height_m=0.5, min_range_m=0.4).height_above(PointColumns.from_array(points), 0.5)
    error = height[on] - (points[on, 2] + 0.5 - 6.75 * slope)
    assert on.sum() > 50
    assert np.abs(np.median(error)) < 0.15


def test_a_kerb_is_ground_and_a_wall_is_not():
    points, on = scans.scan([(20.0, 8.0, 50.0, 4.0, 0.0, 0.12), (20.0, 12.0, 50.0, 1.0, 0.0, 2.0)], step_deg=0.5)
    height = ground().height_above(PointColumns.from_array(points), HEIGHT_M)
    assert (height[on == 0] < 0.15).mean() > 0.99
    assert (height[on == 1] < 0.25).mean() > 0.95
    wall = (on == 2) & (points[:, 2] > -HEIGHT_M + 0.5)
    assert (height[wall] > 0.25).mean() > 0.97


def test_heights_of_points_on_objects():
    points, on = scans.scan([(15.0, 0.0, 4.0, 1.8, 0.0, 1.5), (25.0, 6.0, 0.5, 0.5, 0.0, 1.7)])
    height = ground().height_above(PointColumns.from_array(points), HEIGHT_M)
    assert np.allclose(height[on > 0], points[on > 0, 2] + HEIGHT_M, atol=0.15)


def test_reflections_below_the_ground_do_not_lower_it():
    points, _ = scans.scan()
    rng = np.random.default_rng(3)
    row = rng.choice(len(points), 300, replace=False)
    points[row, 2] -= rng.uniform(0.5, 3.0, 300).astype(np.float32)
    kept = np.setdiff1d(np.arange(len(points)), row)
    height = ground().height_above(PointColumns.from_array(points), HEIGHT_M)
    assert (np.abs(height[kept]) < 0.15).mean() > 0.99


@pytest.mark.parametrize(("x", "y", "width"), [(53.0, 1.0, 3.0), (50.0, 12.0, 3.0), (47.0, 20.0, 4.6)])
def test_the_side_of_a_far_car_is_not_ground(x, y, width):
    points, on = scans.scan([(x, y, 1.8, width, 0.3, 1.6)], step_deg=0.17, azimuth_deg=(-60, 60))
    height = ground().height_above(PointColumns.from_array(points), HEIGHT_M)
    assert np.allclose(height[on == 1], points[on == 1, 2] + HEIGHT_M, atol=0.1)


@pytest.mark.parametrize("beside_m", [2.0, 3.0, 4.0])
def test_the_flank_of_a_car_beside_a_sensor_with_few_low_beams_is_not_ground(beside_m):
    elevation = np.deg2rad([-25.0, -19.0, -14.0, -12.0, -10.0, -8.0, *np.arange(-6.0, 2.0, 0.17)])
    car = (0.0, beside_m + 0.9, 4.5, 1.8, 0.2, 1.5)
    points, on = scans.scan([car, (0.0, beside_m + 6.0, 4.5, 1.8, 0.2, 1.5)], 2.13, elevation)
    height = ground(height_m=2.13).height_above(PointColumns.from_array(points), 2.13)
    assert np.allclose(height[on > 0], points[on > 0, 2] + 2.13, atol=0.2)


def test_the_flank_of_a_car_that_two_beams_meet_is_not_ground():
    elevation = np.deg2rad(np.arange(-15.0, 16.0, 2.0))
    points, on = scans.scan([(21.0, 0.0, 1.8, 4.5, 0.2, 1.5)], 0.8, elevation)
    height = ground(height_m=0.8, min_range_m=0.4).height_above(PointColumns.from_array(points), 0.8)
    assert np.allclose(height[on > 0], points[on > 0, 2] + 0.8, atol=0.15)


def test_ground_that_begins_again_lower_behind_a_crest_is_found():
    def crest(x, y):
        return -HEIGHT_M - 0.06 * np.clip(np.hypot(x, y) - 10, 0, None)

    direction = scans.rays(step_deg=1.0)
    hit = scans.floor_ranges(direction, crest)
    hidden = (hit * np.hypot(direction[:, 0], direction[:, 1]) > 12.0) & (
        hit * np.hypot(direction[:, 0], direction[:, 1]) < 25.0
    )
    seen = np.isfinite(hit) & ~hidden
    points = (direction[seen] * hit[seen, None]).astype(np.float32)
    height = ground().height_above(PointColumns.from_array(points), HEIGHT_M)
    assert (np.abs(height) < 0.25).mean() > 0.97


def test_floor_of_a_small_robot():
    points, on = scans.scan(
        [(3.0, 0.0, 0.4, 0.4, 0.0, 1.7), (0.0, 4.0, 8.0, 0.2, 0.0, 2.5)], 0.3, np.deg2rad(np.linspace(-25, 15, 32))
    )
    near = SensorConfig(height_m=0.3, min_range_m=0.3, max_range_m=30.0)
    height = GroundEstimator(near, MAX_SLOPE_DEG).height_above(PointColumns.from_array(points), 0.3)
    assert (np.abs(height[on == 0]) < 0.1).mean() > 0.98
    assert np.allclose(height[on > 0], points[on > 0, 2] + 0.3, atol=0.1)


def test_the_order_of_the_points_does_not_matter():
    points, _ = scans.scan([(15.0, 0.0, 4.0, 1.8, 0.0, 1.5)])
    order = np.random.default_rng(1).permutation(len(points))
    straight = ground().height_above(PointColumns.from_array(points), HEIGHT_M)
    assert np.array_equal(ground().height_above(PointColumns.from_array(points[order]), HEIGHT_M), straight[order])


@given(seed=st.integers(0, 1000))
@settings(max_examples=8)
def test_tracing_equals_a_loop_over_rays_and_rings(seed):
    rng = np.random.default_rng(seed)
    fast = ground()
    lowest = rng.normal(-HEIGHT_M, 0.25, (fast.grid.rings, SECTORS)).astype(np.float32)
    lowest[rng.random(lowest.shape) < 0.3] = np.inf
    stands = rng.random(lowest.shape) < 0.2
    expected = reference.trace(lowest, stands, fast.grid.range_m.astype(float), HEIGHT_M, MAX_SLOPE_DEG)
    assert (np.array(fast.trace(lowest, stands, HEIGHT_M)) == expected).mean() > 0.999  # float32 against float64


@given(angle=st.floats(-3.14, 3.14), other=st.floats(-3.14, 3.14))
def test_the_pseudo_angle_is_monotonic(angle, other):
    a, b = np.sort(np.array([angle, other])) % (2 * np.pi)
    low, high = min(a, b), max(a, b)
    values = pseudo_angle(*(f(np.array([low, high]) - np.pi / 2).astype(np.float32) for f in (np.cos, np.sin)))
    assert values[0] <= values[1] + 1e-4
    assert (values >= 0).all()
    assert (values <= 4).all()


def test_cells_of_the_polar_grid_are_inside_it():
    rng = np.random.default_rng(0)
    points = PointColumns.from_array(rng.normal(0, 60, (5000, 4)).astype(np.float32))
    grid = PolarGrid(80.0)
    cell = grid.cell(points)
    assert cell.min() >= 0
    assert cell.max() < grid.size


@pytest.mark.parametrize("true_m", [0.3, 0.8, 1.73, 2.5])
def test_the_sensor_height_is_estimated(true_m):
    points, _ = scans.scan([(6.0, 3.0, 4.0, 1.8, 0.0, 1.5), (0.0, -8.0, 30.0, 0.5, 0.0, 3.0)], true_m, step_deg=1.0)
    height = HeightEstimator(SensorConfig(height_m=None, min_range_m=0.5))
    assert height.height_m(points) == pytest.approx(true_m, abs=0.05)


def test_walls_alone_give_the_default_height():
    walls = [
        (x, y, *((3.0, 0.2) if y else (0.2, 3.0)), -1.0, 3.0) for x, y in [(1.2, 0), (-1.4, 0), (0, 1.3), (0, -1.5)]
    ]
    points, on = scans.scan(walls, 0.8, scans.VLP_16, step_deg=0.2)
    assert (on > 0).all()
    sensor = SensorConfig(height_m=None, min_range_m=0.4, elevation_step_deg=2.0)
    assert HeightEstimator(sensor).height_m(points) == DEFAULT_HEIGHT_M


def test_a_floor_mostly_hidden_by_walls_is_found():
    walls = [
        (x, y, *((4.0, 0.2) if y else (0.2, 4.0)), 0.0, 3.0) for x, y in [(1.9, 0), (-1.7, 0), (0, 1.8), (0, -2.0)]
    ]
    points, on = scans.scan(walls, 0.36, scans.VLP_16, step_deg=0.2)
    assert 0.05 < (on == 0).mean() < 0.2
    sensor = SensorConfig(height_m=None, min_range_m=0.4, elevation_step_deg=2.0)
    assert HeightEstimator(sensor).height_m(points) == pytest.approx(0.36, abs=0.03)


def test_no_floor_gives_the_default_height():
    height = HeightEstimator(SensorConfig(height_m=None))
    assert height.height_m(np.zeros((0, 4), np.float32)) == DEFAULT_HEIGHT_M
    assert height.height_m(np.float32([[5, 0, -1, 0]])) == DEFAULT_HEIGHT_M
