import numpy as np

from modt.viewer.point_cells import Cells


def test_thinned_cells_lose_ground_first():
    cells = Cells(np.arange(100), np.where(np.arange(100) % 4 == 0, 3, 0))
    assert len(cells.thinned(1000)) == 100
    for most, standing in ((60, 25), (10, 10), (0, 0)):
        some = cells.thinned(most)
        assert (len(some), np.count_nonzero(some.level)) == (most, standing)
        assert (np.diff(some.cell) > 0).all()
