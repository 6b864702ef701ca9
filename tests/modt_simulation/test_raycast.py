"""Ray casting: windows against batches, hits against points on the surface, and the ground that rays meet."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from modt.geometry import rotation_zyx, se3, transform
from modt_simulation.materials import Material
from modt_simulation.raycast import NO_SOLID, RayCaster
from modt_simulation.sensors import sensor
from modt_simulation.solids import Solids, box, cylinder, ellipsoid, rod, wedge
from modt_simulation.terrain import Terrain

NO_GROUND = np.full((16, 1808), np.inf, np.float32)


def scene(seed, n=40):
    rng = np.random.default_rng(seed)
    made = []
    for _ in range(n):
        size = tuple(rng.uniform(0.2, 3.0, 3))
        solid = (
            box((0, 0, 0), size, Material.WALL),
            ellipsoid((0, 0, 0), size, Material.BARK),
            cylinder((0, 0, 0), size[0], size[1], Material.METAL, axis=int(rng.integers(3))),
            rod((0, 0, 0), size, 0.1, Material.CLOTH),
            wedge((0, 0, 0), size, Material.GLASS, [(1, 0, 0.5, size[0] / 3), (0, 1, 1, size[1] / 3)]),
        )[rng.integers(5)]
        yaw = rng.uniform(0, 7)
        away = rng.uniform(6, 60)
        bearing = rng.uniform(0, 7)
        R = np.array([[np.cos(yaw), -np.sin(yaw), 0], [np.sin(yaw), np.cos(yaw), 0], [0, 0, 1]])
        made.append(solid.transformed(R, away * np.array([np.cos(bearing), np.sin(bearing), rng.uniform(-0.1, 0.1)])))
    return Solids.join(made)


@settings(max_examples=25)
@given(st.integers(0, 1000))
def test_batches_and_single_windows_hit_the_same_solids(seed):
    solids = scene(seed)
    depth = np.ones_like(NO_GROUND)
    single = RayCaster(sensor("vlp-16"), batch_rays=0).cast(solids, NO_GROUND, depth)
    batched = RayCaster(sensor("vlp-16"), batch_rays=10**9).cast(solids, NO_GROUND, depth)
    same = single.solid == batched.solid
    assert same.mean() > 0.9999  # float32 may tip a grazing ray either way
    hit = same & (batched.solid != NO_SOLID)
    np.testing.assert_allclose(single.distance[hit], batched.distance[hit], rtol=2e-5)


@settings(max_examples=25)
@given(st.integers(0, 1000))
def test_windows_contain_every_ray_that_hits(seed):
    class Everywhere(RayCaster):
        def windows(self, solids):
            near = super().windows(solids)
            n = len(solids)
            whole = np.tile([0, 16], (n, 1)), np.tile([0, 1808], (n, 1))
            return type(near)(np.arange(n), *whole, np.zeros(n, np.float32))

    solids = scene(seed, n=6)
    depth = np.ones_like(NO_GROUND)
    found, whole = (
        make(sensor("vlp-16")).cast(solids, NO_GROUND, depth).distance for make in (RayCaster, Everywhere)
    )
    assert np.isfinite(found).sum() == np.isfinite(whole).sum()


def test_an_ellipsoid_is_hit_on_its_surface():
    ball = ellipsoid((10.0, 3.0, 0.5), (2.0, 2.0, 2.0), Material.WALL)
    caster = RayCaster(sensor("vlp-16"))
    image = caster.cast(ball, NO_GROUND, np.ones_like(NO_GROUND))
    row, column = np.nonzero(image.solid == 0)
    s = image.distance[row, column]
    met = np.stack([s * caster.cos[column], s * caster.sin[column], s * caster.tangent[row, 0]], axis=1)
    assert len(met) > 500
    np.testing.assert_allclose(np.linalg.norm(met - [10.0, 3.0, 0.5], axis=1), 2.0, atol=1e-4)


def test_foliage_transmits_by_its_density(rng):
    hedge = box((20.0, 0.0, 0.0), (1.0, 12.0, 12.0), Material.FOLIAGE, density=1.5)
    depth = rng.standard_exponential(NO_GROUND.shape, np.float32)
    image = RayCaster(sensor("vlp-16")).cast(hedge, NO_GROUND, depth)
    window = image.solid[4:12, :25]
    assert np.mean(window == NO_SOLID) == pytest.approx(np.exp(-1.5), abs=0.06)


CELL_M = 0.25
SIDE = 800
HEIGHT_M = 1.7
NOISE_M = 0.02


def hills(lift_m, length_m, phase) -> Terrain:
    """A square around the sensor with waves along x, at height 0 beneath the sensor."""
    corner = np.full(2, -CELL_M * SIDE / 2)
    x = corner[0] + CELL_M * (np.arange(SIDE) + 0.5)
    heights = lift_m * (np.sin(2 * np.pi * x / length_m + phase) - np.sin(phase))
    surface = np.full((SIDE, SIDE), Material.ASPHALT, np.uint8)
    return Terrain(corner, CELL_M, np.tile(heights[:, None], SIDE).astype(np.float32), surface)


@pytest.mark.slow
@settings(max_examples=20, deadline=None)
@given(
    lift_m=st.floats(0.0, 3.0),
    length_m=st.floats(40.0, 250.0),
    phase=st.floats(0.0, 6.0),
    turn_rad=st.tuples(st.floats(-0.05, 0.05), st.floats(-0.05, 0.05), st.floats(-3.0, 3.0)),
    name=st.sampled_from(["vlp-16", "pandar64", "mid-360"]),
)
def test_rays_end_on_the_first_ground_they_meet(lift_m, length_m, phase, turn_rad, name):
    terrain = hills(lift_m, length_m, phase)
    caster = RayCaster(sensor(name))
    T_world_sensor = se3(rotation_zyx(*turn_rad), np.array([0.0, 0.0, HEIGHT_M]))
    distance, _ = terrain.cast(caster, T_world_sensor)
    row, column = np.nonzero(np.isfinite(distance))
    assert len(row)
    step_m = lift_m * 2 * np.pi / length_m * CELL_M + NOISE_M
    for share in (0.25, 0.5, 0.75, 0.9, 1.0):
        s = share * distance[row, column].astype(float)
        up = s * caster.tangent[row, 0] + caster.origin[row, 0]
        x, y, z = transform(T_world_sensor, np.c_[s * caster.cos[column], s * caster.sin[column], up]).T
        above_m = z - terrain.heights(x, y)
        assert (above_m > -step_m - 0.001 * s).all()
        # within a halved interval of the series: 0.1 % of the distance
        assert share < 1.0 or (above_m < step_m + 0.001 * s).all()
