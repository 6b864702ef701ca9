import numpy as np

from modt.profile import load
from modt.viewer.packed import SIDE
from modt_desk.simulation.synthetic_stream import SyntheticStream
from modt_desk.viewer.view import Grid


def test_a_cell_shows_its_highest_point_and_ground_as_such():
    config = load("vlp-16")
    points = next(iter(SyntheticStream("street", "vlp-16", 0.1, seed=2))).points
    grid = Grid(config)
    pole = np.zeros((5, 4), np.float32)
    pole[:, :2] = 9.01, -4.01
    pole[:, 2] = -config.sensor.height_m + np.array([0.5, 2.0, 1.0, 1.5, 0.7])
    without, cells = (grid.cells(given) for given in (points, np.concatenate([points, pole])))
    column, row = (int(np.floor(v * 100 / grid.step_cm)) + SIDE // 2 for v in (9.01, -4.01))
    (level,) = cells.level[cells.cell == SIDE * row + column]
    assert 18 <= level <= 22
    assert (np.diff(cells.cell) > 0).all()
    ground = without.level == 0
    assert 0.2 < ground.mean() < 0.9
    x = ((without.cell % SIDE) + 0.5 - SIDE / 2) * grid.step_cm / 100
    assert np.abs(x).max() < config.sensor.max_range_m
