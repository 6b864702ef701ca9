"""Pieces met by rays: the two ways of casting against each other and against points on the surface."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from modt.simulation.materials import Material
from modt.simulation.raycast import NOTHING, RayCaster
from modt.simulation.sensors import SENSORS, sensor
from modt.simulation.solids import Pieces, box, cylinder, ellipsoid, limb, wedge

NO_GROUND = np.full((16, 1808), np.inf, np.float32)


def scene(seed, n=40):
    rng = np.random.default_rng(seed)
    made = []
    for _ in range(n):
        size = tuple(rng.uniform(0.2, 3.0, 3))
        piece = (
            box((0, 0, 0), size, Material.WALL),
            ellipsoid((0, 0, 0), size, Material.BARK),
            cylinder((0, 0, 0), size[0], size[1], Material.METAL, axis=int(rng.integers(3))),
            limb((0, 0, 0), size, 0.1, Material.CLOTH),
            wedge((0, 0, 0), size, Material.GLASS, [(1, 0, 0.5, size[0] / 3), (0, 1, 1, size[1] / 3)]),
        )[rng.integers(5)]
        yaw, away, bearing = rng.uniform(0, 7), rng.uniform(6, 60), rng.uniform(0, 7)
        R = np.array([[np.cos(yaw), -np.sin(yaw), 0], [np.sin(yaw), np.cos(yaw), 0], [0, 0, 1]])
        made.append(piece.moved(R, away * np.array([np.cos(bearing), np.sin(bearing), rng.uniform(-0.1, 0.1)])))
    return Pieces.join(made)


@settings(max_examples=25)
@given(st.integers(0, 1000))
def test_rays_cast_together_meet_what_windows_cast_one_by_one_meet(seed):
    pieces, depth = scene(seed), np.ones_like(NO_GROUND)
    one_by_one = RayCaster(sensor("vlp-16"), batch_rays=0).cast(pieces, NO_GROUND, depth)
    together = RayCaster(sensor("vlp-16"), batch_rays=10**9).cast(pieces, NO_GROUND, depth)
    same = one_by_one.piece == together.piece
    assert same.mean() > 0.9999  # float32 may tip a grazing ray either way
    hit = same & (together.piece != NOTHING)
    np.testing.assert_allclose(one_by_one.distance[hit], together.distance[hit], rtol=2e-5)


@settings(max_examples=25)
@given(st.integers(0, 1000))
def test_windows_leave_out_no_ray_that_hits(seed):
    pieces = scene(seed, n=6)
    caster = RayCaster(sensor("vlp-16"))
    found = caster.cast(pieces, NO_GROUND, np.ones_like(NO_GROUND)).distance

    class Everywhere(RayCaster):
        def windows(self, pieces):
            near = super().windows(pieces)
            n = len(pieces)
            whole = np.tile([0, 16], (n, 1)), np.tile([0, 1808], (n, 1))
            return type(near)(np.arange(n), *whole, np.zeros(n, np.float32), 1808)

    whole = Everywhere(sensor("vlp-16")).cast(pieces, NO_GROUND, np.ones_like(NO_GROUND)).distance
    assert np.isfinite(found).sum() == np.isfinite(whole).sum()


def test_a_ball_is_met_on_its_surface():
    ball = ellipsoid((10.0, 3.0, 0.5), (2.0, 2.0, 2.0), Material.WALL)
    caster = RayCaster(sensor("vlp-16"))
    image = caster.cast(ball, NO_GROUND, np.ones_like(NO_GROUND))
    row, column = np.nonzero(image.piece == 0)
    s = image.distance[row, column]
    met = np.stack([s * caster.cos[column], s * caster.sin[column], s * caster.tangent[row, 0]], axis=1)
    assert len(met) > 500
    np.testing.assert_allclose(np.linalg.norm(met - [10.0, 3.0, 0.5], axis=1), 2.0, atol=1e-4)


def test_the_nearer_of_two_walls_hides_the_other():
    walls = Pieces.join(box((x, 0.0, 0.0), (0.2, 4.0, 4.0), Material.WALL) for x in (12.0, 8.0))
    image = RayCaster(sensor("vlp-16")).cast(walls, NO_GROUND, np.ones_like(NO_GROUND))
    ahead = image.piece[8, [0, -1]]
    assert ahead.tolist() == [1, 1]


def test_foliage_lets_the_share_of_rays_through_that_its_density_says():
    rng = np.random.default_rng(0)
    hedge = box((20.0, 0.0, 0.0), (1.0, 12.0, 12.0), Material.FOLIAGE)
    hedge.density[:] = 1.5
    depth = rng.standard_exponential(NO_GROUND.shape, np.float32)
    image = RayCaster(sensor("vlp-16")).cast(hedge, NO_GROUND, depth)
    window = image.piece[4:12, :25]
    assert np.mean(window == NOTHING) == pytest.approx(np.exp(-1.5), abs=0.06)


@pytest.mark.parametrize("name", SENSORS)
def test_every_sensor_sees_a_wall_around_it(name):
    model = sensor(name)
    walls = Pieces.join(
        box((10 * c, 10 * s, 0.0), (8.0, 8.0, 20.0), Material.WALL) for c, s in ((1, 0), (0, 1), (-1, 0), (0, -1))
    )
    nothing = np.full(model.shape, np.inf, np.float32)
    image = RayCaster(model).cast(walls, nothing, np.ones(model.shape, np.float32))
    assert np.isfinite(image.distance).mean() > 0.4
    assert np.nanmin(image.distance) >= 5.9
