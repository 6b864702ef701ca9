import numpy as np
import pytest

from modt.viewer.packed import packed_cells, packed_table
from modt.viewer.point_cells import SIDE, Cells

from . import pages


@pytest.mark.parametrize("n", [0, 500])
def test_cells_come_back(n):
    random = np.random.default_rng(3)
    cell = np.unique(np.append(random.integers(0, SIDE**2, n), [0, SIDE**2 - 1][:n]))
    cells = Cells(cell, random.integers(0, 64, len(cell)))
    number, level = pages.cells(packed_cells(cells))
    np.testing.assert_array_equal(number, cells.cell)
    np.testing.assert_array_equal(level, cells.level)


def test_a_table_comes_back_with_numbers_of_either_sign():
    table = np.array([[0, -1, 2**31 - 1], [5, -70000, -(2**31)], [3, 9, 0]])
    np.testing.assert_array_equal(pages.table(packed_table(table), 3), table)


def test_thinned_cells_lose_ground_first():
    cells = Cells(np.arange(100), np.where(np.arange(100) % 4 == 0, 3, 0))
    assert len(cells.thinned(1000)) == 100
    for most, standing in ((60, 25), (10, 10), (0, 0)):
        some = cells.thinned(most)
        assert (len(some), np.count_nonzero(some.level)) == (most, standing)
        assert (np.diff(some.cell) > 0).all()
