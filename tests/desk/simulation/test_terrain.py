"""The ground, and where rays meet it."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from modt.geometry import rotation_zyx, se3, transform
from modt_desk.simulation.materials import Material
from modt_desk.simulation.raycast import RayCaster
from modt_desk.simulation.sensors import sensor
from modt_desk.simulation.terrain import Terrain

CELL_M, SIDE = 0.25, 800
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
    terrain, caster = hills(lift_m, length_m, phase), RayCaster(sensor(name))
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
