import numpy as np

from modt.viewer.packed import Cells, packed_table

from . import pages


def test_a_table_comes_back_with_numbers_of_either_sign():
    table = np.array([[0, -1, 2**31 - 1], [5, -70000, -(2**31)], [3, 9, 0]])
    np.testing.assert_array_equal(pages.table(packed_table(table), 3), table)


def test_thinned_cells_lose_ground_first():
    cells = Cells(np.arange(100), np.where(np.arange(100) % 4 == 0, 3, 0))
    assert len(cells.thinned(1000).cell) == 100
    for most, standing in ((60, 25), (10, 10), (0, 0)):
        some = cells.thinned(most)
        assert (len(some.cell), np.count_nonzero(some.level)) == (most, standing)
        assert (np.diff(some.cell) > 0).all()
