"""Ray casting: windows against batches, and hits against points on the surface."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from modt_desk.simulation.materials import Material
from modt_desk.simulation.raycast import NO_SOLID, RayCaster
from modt_desk.simulation.sensors import sensor
from modt_desk.simulation.solids import Solids, box, cylinder, ellipsoid, rod, wedge

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
        yaw, away, bearing = rng.uniform(0, 7), rng.uniform(6, 60), rng.uniform(0, 7)
        R = np.array([[np.cos(yaw), -np.sin(yaw), 0], [np.sin(yaw), np.cos(yaw), 0], [0, 0, 1]])
        made.append(solid.transformed(R, away * np.array([np.cos(bearing), np.sin(bearing), rng.uniform(-0.1, 0.1)])))
    return Solids.join(made)


@settings(max_examples=25)
@given(st.integers(0, 1000))
def test_batches_and_single_windows_hit_the_same_solids(seed):
    solids, depth = scene(seed), np.ones_like(NO_GROUND)
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

    solids, depth = scene(seed, n=6), np.ones_like(NO_GROUND)
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


def test_foliage_transmits_by_its_density():
    rng = np.random.default_rng(0)
    hedge = box((20.0, 0.0, 0.0), (1.0, 12.0, 12.0), Material.FOLIAGE, density=1.5)
    depth = rng.standard_exponential(NO_GROUND.shape, np.float32)
    image = RayCaster(sensor("vlp-16")).cast(hedge, NO_GROUND, depth)
    window = image.solid[4:12, :25]
    assert np.mean(window == NO_SOLID) == pytest.approx(np.exp(-1.5), abs=0.06)
