import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from modt.config import SegmentationConfig, SensorConfig
from modt.geometry import pseudo_angle
from modt.segmentation.grids import SECTORS, PointColumns
from modt.segmentation.ground import GroundEstimator
from modt.segmentation.sensor_height import HeightEstimator
from modt.segmentation.tuning import SegmentationTuning
from modt.types import NONE
from modt_simulation.synthetic_stream import SyntheticStream
from tests.segmentation import reference, scans

HEIGHT_M = 1.73
DEFAULT_HEIGHT_M = SegmentationTuning().sensor_height.default_m
MAX_SLOPE_DEG = SegmentationConfig().max_slope_deg
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


def on_floor(profile, **rays):
    """(n, 4) points of a sweep over a floor of this profile."""
    direction = scans.rays(**{"step_deg": 1.0, **rays})
    hit = scans.floor_ranges(direction, profile)
    seen = np.isfinite(hit)
    return (direction[seen] * hit[seen, None]).astype(np.float32)


def heights(points, estimator=None, height_m=HEIGHT_M):
    return (estimator or ground()).height_above(PointColumns.from_array(points), height_m)


@pytest.mark.parametrize("name", PROFILES)
def test_ground_of_each_profile_is_found(name):
    assert (np.abs(heights(on_floor(PROFILES[name]))) < 0.25).mean() > 0.97


@pytest.mark.parametrize(("max_slope_deg", "is_ground"), [(4.0, False), (14.0, True), (20.0, True)])
def test_the_steepest_ground_is_a_key(max_slope_deg, is_ground):
    points = on_floor(lambda x, y: -HEIGHT_M + np.tan(np.deg2rad(13)) * np.clip(x - 5, 0, 10))
    height = heights(points, GroundEstimator(SensorConfig(), max_slope_deg))
    assert ((np.abs(height[points[:, 0] > 7]) < 0.25).mean() > 0.95) == is_ground


@pytest.mark.parametrize(
    ("elevation", "step_deg", "height_m", "slope", "x"),
    [
        (scans.VLP_16, 0.2, 0.8, 0.268, 8.75),
        (np.deg2rad(np.linspace(-22.5, 22.5, 64)), 0.35, 0.5, 0.268, 10.75),
        (scans.VLP_16, 0.2, 0.3, 0.14, 12.5),
        (scans.VLP_16, 0.2, 0.3, 0.2, 13.0),
    ],
)
def test_heights_of_a_person_on_a_ramp_are_above_the_ramp(elevation, step_deg, height_m, slope, x):
    """The ground that the person hides is that beside them, or before them where no beam meets it any more."""
    direction = scans.rays(elevation, step_deg=step_deg)
    hit = scans.floor_ranges(direction, lambda x, y: -height_m + slope * np.clip(x - 4, 0, 10))
    foot_m = slope * (x - 4) - height_m
    person = scans.box_ranges(direction, (x, -0.3, foot_m), (x + 0.5, 0.3, foot_m + 1.75))
    nearest = np.minimum(hit, person)
    points = (direction * nearest[:, None])[np.isfinite(nearest)].astype(np.float32)
    on = (person < hit)[np.isfinite(nearest)]
    height = heights(points, ground(height_m=height_m, min_range_m=0.4), height_m)
    assert on.sum() > 50
    assert np.abs(np.median(height[on] - (points[on, 2] - foot_m))) < 0.15


def test_a_kerb_is_ground_and_a_wall_is_not():
    points, on = scans.scan([(20.0, 8.0, 50.0, 4.0, 0.0, 0.12), (20.0, 12.0, 50.0, 1.0, 0.0, 2.0)], step_deg=0.5)
    height = heights(points)
    assert (height[on == 0] < 0.15).mean() > 0.99
    assert (height[on == 1] < 0.25).mean() > 0.95
    wall = (on == 2) & (points[:, 2] > -HEIGHT_M + 0.5)
    assert (height[wall] > 0.25).mean() > 0.97


FEW_LOW_BEAMS = np.deg2rad([-25.0, -19.0, -14.0, -12.0, -10.0, -8.0, *np.arange(-6.0, 2.0, 0.17)])
SMALL_ROBOT = {"height_m": 0.3, "min_range_m": 0.3, "max_range_m": 30.0}
ROOM = [(3.0, 0.0, 0.4, 0.4, 0.0, 1.7), (0.0, 4.0, 8.0, 0.2, 0.0, 2.5)]
FAR = {"step_deg": 0.17, "azimuth_deg": (-60, 60)}


def two_cars(beside_m):
    return [(0.0, beside_m + gap_m, 4.5, 1.8, 0.2, 1.5) for gap_m in (0.9, 6.0)]


@pytest.mark.parametrize(
    ("boxes", "sensor", "scan", "atol"),
    [
        ([(15.0, 0.0, 4.0, 1.8, 0.0, 1.5), (25.0, 6.0, 0.5, 0.5, 0.0, 1.7)], {}, {}, 0.15),
        *(([(x, y, 1.8, w, 0.3, 1.6)], {}, FAR, 0.1) for x, y, w in [(53, 1, 3.0), (50, 12, 3.0), (47, 20, 4.6)]),
        *((two_cars(y), {"height_m": 2.13}, {"elevation": FEW_LOW_BEAMS}, 0.2) for y in (2.0, 3.0, 4.0)),
        ([(21.0, 0.0, 1.8, 4.5, 0.2, 1.5)], {"height_m": 0.8, "min_range_m": 0.4}, {"elevation": scans.VLP_16}, 0.15),
        ([(25.2, 0, 4, 1.8, 0.2, 0.9), (25.6, 0, 2, 1.7, 0.9, 1.5)], {}, {"elevation": scans.VLP_16}, 0.15),
        (ROOM, SMALL_ROBOT, {"elevation": np.deg2rad(np.linspace(-25, 15, 32))}, 0.1),
    ],
)
def test_sides_of_objects_are_not_ground(boxes, sensor, scan, atol):
    """Near and far cars, one that few low beams meet, one by its bonnet, a person and a wall before a small robot."""
    height_m = sensor.get("height_m", HEIGHT_M)
    points, on = scans.scan(boxes, height_m, **scan)
    height = heights(points, ground(**sensor), height_m)
    assert np.allclose(height[on > 0], points[on > 0, 2] + height_m, atol=atol)
    assert (np.abs(height[on == 0]) < 0.1).mean() > 0.98


def test_a_car_that_hides_all_ground_before_it_is_not_ground():
    """Its bumper is the first return of its rays, and one beam meets each of its heights, as behind another car."""
    front = [(6.48, 0.5), (6.58, 0.58), (6.68, 0.8), (6.78, 0.92), (7.4, 0.93), (8.0, 0.98), (8.3, 1.25), (8.9, 1.4)]
    y = np.linspace(-0.9, 0.9, 40)
    car = np.array([(x, side, up_m - HEIGHT_M, 0.5) for x, up_m in front for side in y], np.float32)
    beside = on_floor(PROFILES["flat"])
    hidden = (beside[:, 0] > 0) & (np.abs(beside[:, 1]) < 0.2 * beside[:, 0])
    height = heights(np.concatenate([car[:, :3], beside[~hidden]]))[: len(car)]
    assert height == pytest.approx(car[:, 2] + HEIGHT_M, abs=0.15)


@pytest.mark.parametrize("x", [1.4, 1.8, 2.2])
@pytest.mark.parametrize("top_m", [0.28, 0.4])
@pytest.mark.parametrize(
    ("elevation", "height_m"),
    [
        (scans.VLP_16, 0.8),
        (np.deg2rad(np.linspace(-22.5, 22.5, 64)), 0.8),
        (np.deg2rad(np.linspace(-7, 52, 60)), 0.3),
    ],
    ids=["vlp-16", "os1-64", "dome"],
)
def test_what_lies_nearer_than_all_visible_ground_is_not_ground(x, top_m, elevation, height_m):
    """A low wall, as wide as a car is long, of which the sensor sees the top and the upper part of the front."""
    points, on = scans.scan([(x, 0.0, 0.4, 4.0, 0.0, top_m)], height_m, elevation)
    height = heights(points, ground(height_m=height_m, min_range_m=0.4), height_m)
    wall = on > 0
    assert wall.sum() > 50
    assert height[wall] == pytest.approx(points[wall, 2] + height_m, abs=0.12)
    assert (np.abs(height[~wall]) < 0.1).all()


def test_reflections_below_the_ground_do_not_lower_it():
    points, _ = scans.scan()
    rng = np.random.default_rng(3)
    row = rng.choice(len(points), 300, replace=False)
    points[row, 2] -= rng.uniform(0.5, 3.0, 300).astype(np.float32)
    assert (np.abs(np.delete(heights(points), row)) < 0.15).mean() > 0.99


def test_ground_that_begins_again_lower_behind_a_crest_is_found():
    points = on_floor(lambda x, y: -HEIGHT_M - 0.06 * np.clip(np.hypot(x, y) - 10, 0, None))
    range_m = np.hypot(points[:, 0], points[:, 1])
    assert (np.abs(heights(points[(range_m <= 12.0) | (range_m >= 25.0)])) < 0.25).mean() > 0.97


@given(seed=st.integers(0, 1000))
@settings(max_examples=8)
def test_tracing_equals_a_loop_over_rays_and_rings(seed):
    rng = np.random.default_rng(seed)
    fast = ground()
    lowest = rng.normal(-HEIGHT_M, 0.25, (fast.grid.rings, SECTORS)).astype(np.float32)
    lowest[rng.random(lowest.shape) < 0.3] = np.inf
    spread = np.where(np.isfinite(lowest), rng.uniform(0.0, 0.6, lowest.shape), 0.0)
    top = np.where(np.isfinite(lowest), lowest + spread, -np.inf).astype(np.float32)
    expected = reference.trace(lowest, top, fast, HEIGHT_M, MAX_SLOPE_DEG)
    rays = fast.trace(lowest, top, HEIGHT_M)
    found = np.array([rays.is_ground, rays.is_ramp, rays.stands])
    assert (found == expected[:3]).mean() > 0.999  # float32 against float64
    assert np.isclose(rays.lowest, expected[3], atol=2e-3).mean() > 0.999
    assert np.isclose(rays.end_slope, expected[4], atol=1e-3).mean() > 0.97


def waves(x, y, height_m=0.8):
    """Hills of 1 m in 20 m below a sensor that stands on the slope of one, parallel to it."""
    return np.sin(np.pi * x / 10) - np.pi / 10 * x - height_m + 0.0 * y


@pytest.mark.parametrize("elevation", [scans.VLP_16, np.deg2rad(np.linspace(-22.5, 22.5, 64))])
def test_a_hill_opposite_is_ground(elevation):
    points = on_floor(waves, elevation=elevation)
    near = points[(np.abs(points[:, 0]) < 14.0) & (np.abs(points[:, 1]) < 3.0)]
    assert near[:, 2].max() > 1.0
    assert (np.abs(heights(near, ground(height_m=0.8, min_range_m=0.4), 0.8)) < 0.25).mean() > 0.98


@pytest.mark.parametrize(
    ("elevation", "height_m", "bend"),
    [(scans.HDL_64E, 1.7, 0.08), (np.deg2rad(np.linspace(-22.5, 22.5, 64)), 0.8, 0.16)],
)
def test_the_sides_of_a_valley_are_ground(elevation, height_m, bend):
    """They rise nearer than all visible ground there, but the ground along the valley leads to them."""
    points = on_floor(lambda x, y: 0.5 * bend * x**2 - height_m + 0.0 * y, elevation=elevation)
    near = points[np.hypot(points[:, 0], points[:, 1]) < 4.5]
    assert (np.abs(heights(near, ground(height_m=height_m, min_range_m=0.4), height_m)) < 0.2).mean() > 0.99


def test_a_crest_is_no_low_thing():
    """A wheeled robot with a low sensor on rolling ground, whose crests fall to both sides."""
    frame, truth = SyntheticStream("hills", "mid-360", 4.0, 2400, height_m=0.3).simulator.sweep(0)
    is_near = (truth.instance == NONE) & (np.hypot(*frame.points[:, :2].T) < 5.0)
    height = heights(frame.points, ground(height_m=0.3, min_range_m=0.4), 0.3)[is_near]
    assert len(height) > 1000
    assert (height < 0.1).mean() > 0.96


def with_person(profile, x, floor_z, elevation=scans.VLP_16):
    """(n, 4) points of a sweep over a floor, and (n,) those on a person of 1.7 m at x ahead with feet at floor_z."""
    direction = scans.rays(step_deg=0.2, elevation=elevation)
    ahead = direction[:, 0] > 0.1
    to_person = np.where(ahead, x / np.where(ahead, direction[:, 0], 1.0), np.inf)
    y, z = (np.where(ahead, direction[:, axis] * np.minimum(to_person, 1e3), np.inf) for axis in (1, 2))
    meets = (np.abs(y) < 0.25) & (z > floor_z) & (z < floor_z + 1.7)
    hit = scans.floor_ranges(direction, profile)
    on = meets & (to_person < np.where(np.isfinite(hit), hit, np.inf))
    hit = np.where(on, to_person, hit)
    seen = np.isfinite(hit)
    return (direction[seen] * hit[seen, None]).astype(np.float32), on[seen]


@pytest.mark.parametrize("x", [7.0, 8.0, 9.0])
@pytest.mark.parametrize("elevation", [scans.VLP_16, np.deg2rad(np.linspace(-22.5, 22.5, 64))])
def test_the_lowest_return_of_a_person_whose_feet_an_edge_hides_is_above_the_ground(x, elevation):
    points, on = with_person(lambda x, y: -0.8 - 0.8 * np.clip(x - 5, 0, 1), x, -1.6, elevation)
    height = heights(points, ground(height_m=0.8, min_range_m=0.4), 0.8)
    assert on.sum() > 20
    assert (points[on, 2] > -1.5).all()
    assert (height[on] > 0.05).all()


@pytest.mark.parametrize("x", [4.0, 5.0, 6.0])
def test_the_ground_behind_a_person_on_a_hillside_is_found_by_the_rays_beside(x):
    def hillside(x, y):
        return -0.8 + np.minimum(0.02 * np.clip(x - 2, 0, None) ** 2, 0.08 + 0.35 * np.clip(x - 2, 0, None))

    points, on = with_person(hillside, x, hillside(x, 0.0), np.deg2rad(np.linspace(-22.5, 22.5, 64)))
    behind = ~on & (points[:, 0] > x + 0.7) & (points[:, 0] < 13.0) & (np.abs(points[:, 1]) < 2.0)
    assert (np.abs(heights(points, ground(height_m=0.8, min_range_m=0.4), 0.8)[behind]) < 0.25).all()


def test_heights_are_those_above_the_slope_below_each_point():
    points = on_floor(lambda x, y: -HEIGHT_M + 0.2 * x)
    ahead = (points[:, 0] > 3.0) & (points[:, 0] < 12.0) & (np.abs(points[:, 1]) < 3.0)
    assert (np.abs(heights(points)[ahead]) < 0.1).mean() > 0.97


def test_the_pseudo_angle_is_monotonic():
    angle = np.linspace(-np.pi / 2, 1.4999 * np.pi, 10_001)
    values = pseudo_angle(np.cos(angle).astype(np.float32), np.sin(angle).astype(np.float32))
    assert (np.diff(values) > 0).all()
    assert 0 <= values[0] < values[-1] <= 4


@pytest.mark.parametrize("true_m", [0.3, 0.8, 1.73, 2.5])
def test_the_sensor_height_is_estimated(true_m):
    points, _ = scans.scan([(6.0, 3.0, 4.0, 1.8, 0.0, 1.5), (0.0, -8.0, 30.0, 0.5, 0.0, 3.0)], true_m, step_deg=1.0)
    height = HeightEstimator(SensorConfig(height_m=None, min_range_m=0.5))
    assert height.height_m(points) == pytest.approx(true_m, abs=0.05)


@pytest.mark.parametrize(
    ("walls", "bottom_m", "true_m", "floor", "found_m"),
    [
        ([(1.2, 0), (-1.4, 0), (0, 1.3), (0, -1.5)], -1.0, 0.8, (-1.0, 0.0), DEFAULT_HEIGHT_M),
        ([(1.9, 0), (-1.7, 0), (0, 1.8), (0, -2.0)], 0.0, 0.36, (0.05, 0.2), 0.36),
    ],
    ids=["walls alone", "floor mostly hidden by walls"],
)
def test_the_sensor_height_between_near_walls(walls, bottom_m, true_m, floor, found_m):
    boxes = [(x, y, *((4.0, 0.2) if y else (0.2, 4.0)), bottom_m, 3.0) for x, y in walls]
    points, on = scans.scan(boxes, true_m, scans.VLP_16, step_deg=0.2)
    assert floor[0] < (on == 0).mean() <= floor[1]
    sensor = SensorConfig(height_m=None, min_range_m=0.4, elevation_step_deg=2.0)
    assert HeightEstimator(sensor).height_m(points) == pytest.approx(found_m, abs=0.03)


def test_no_floor_gives_the_default_height():
    height = HeightEstimator(SensorConfig(height_m=None))
    assert height.height_m(np.zeros((0, 4), np.float32)) == DEFAULT_HEIGHT_M
    assert height.height_m(np.float32([[5, 0, -1, 0]])) == DEFAULT_HEIGHT_M
