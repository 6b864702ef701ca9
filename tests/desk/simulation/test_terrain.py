"""The ground, and where rays meet it."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from modt.geometry import rotation_zyx, se3
from modt_desk.simulation.materials import Material
from modt_desk.simulation.raycast import RayCaster
from modt_desk.simulation.sensors import sensor
from modt_desk.simulation.terrain import Terrain

CELL_M, SIDE = 0.25, 800
HEIGHT_M = 1.7
NOISE_M = 0.02


def ground(height) -> Terrain:
    """A square around the sensor, of a height given by x and y."""
    corner = np.full(2, -CELL_M * SIDE / 2)
    axis = corner[0] + CELL_M * (np.arange(SIDE) + 0.5)
    heights = height(axis[:, None], axis[None]) + np.zeros((SIDE, SIDE))
    surface = np.where(axis[:, None] > 0, Material.GRASS, Material.ASPHALT) * np.ones(SIDE)
    return Terrain(corner, CELL_M, heights.astype(np.float32), surface.astype(np.uint8))


def tilted(pitch_rad=0.0, roll_rad=0.0):
    """(4, 4) pose of a sensor above the origin."""
    return se3(rotation_zyx(roll_rad, pitch_rad, 0.0), np.array([0.0, 0.0, HEIGHT_M]))


def points_on(terrain: Terrain, caster: RayCaster, T, share=1.0):
    """(n, 3) points of rays at a share of their distance to the ground [m, world], and its material."""
    distance, surface = terrain.cast(caster, T)
    row, column = np.nonzero(np.isfinite(distance))
    s = share * distance[row, column].astype(float)
    up = s * caster.tangent[row, 0] + caster.origin[row, 0]
    local = np.stack([s * caster.cos[column], s * caster.sin[column], up], axis=1)
    return local @ T[:3, :3].T + T[:3, 3], surface[row, column]


@pytest.mark.slow
@settings(max_examples=20, deadline=None)
@given(
    lift=st.floats(0.0, 3.0),
    length_m=st.floats(40.0, 250.0),
    bearing=st.floats(-3.0, 3.0),
    phase=st.floats(0.0, 6.0),
    pitch_rad=st.floats(-0.05, 0.05),
    roll_rad=st.floats(-0.05, 0.05),
    name=st.sampled_from(["vlp-16", "pandar64", "mid-360"]),
)
def test_rays_end_on_the_first_ground_they_meet(lift, length_m, bearing, phase, pitch_rad, roll_rad, name):
    k = 2 * np.pi / length_m

    def hills(x, y):
        return lift * (np.sin(k * (np.cos(bearing) * x + np.sin(bearing) * y) + phase) - np.sin(phase))

    terrain, caster, T = ground(hills), RayCaster(sensor(name)), tilted(pitch_rad, roll_rad)
    met, _ = points_on(terrain, caster, T)
    step_m = lift * k * CELL_M + NOISE_M
    assert len(met)
    # within a halved interval of the series: 0.1 % of the distance
    off = met[:, 2] - terrain.heights(met[:, 0], met[:, 1])
    assert np.all(np.abs(off) < step_m + 0.001 * np.hypot(met[:, 0], met[:, 1]))
    for share in (0.25, 0.5, 0.75, 0.9):
        before, _ = points_on(terrain, caster, T, share)
        assert np.all(before[:, 2] > terrain.heights(before[:, 0], before[:, 1]) - step_m)


def test_the_material_is_that_of_the_place():
    caster = RayCaster(sensor("hdl-64e"))
    met, surface = points_on(ground(lambda x, y: 0 * x), caster, tilted())
    away = np.abs(met[:, 0]) > CELL_M
    np.testing.assert_array_equal(surface[away], np.where(met[away, 0] > 0, Material.GRASS, Material.ASPHALT))
