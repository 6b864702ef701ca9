import numpy as np

from modt.types import PointKind
from modt.viewer import theme
from modt.viewer.packed import PLAIN, Cells, group_of, occupied, packed_cells, packed_table

from . import pages


def test_a_table_comes_back_with_numbers_of_either_sign():
    table = np.array([[0, -1, 2**31 - 1], [5, -70000, -(2**31)], [3, 9, 0]])
    np.testing.assert_array_equal(pages.table(packed_table(table), 3), table)


def test_thinned_cells_lose_ground_first():
    cells = Cells(np.arange(100), np.where(np.arange(100) % 4 == 0, 3, 0), np.arange(100) % 3)
    assert len(cells.thinned(1000).cell) == 100
    for most, standing in ((60, 25), (10, 10), (0, 0)):
        some = cells.thinned(most)
        assert (len(some.cell), np.count_nonzero(some.level)) == (most, standing)
        assert (np.diff(some.cell) > 0).all()


def test_every_kind_has_its_look_and_ground_is_below_everything():
    kinds = [*PointKind]
    x = np.repeat(np.arange(len(kinds), dtype=np.float32), 2)
    kind = np.array([each for kind in kinds for each in (kind, PointKind.GROUND)], np.int8)
    level = np.where(kind == PointKind.GROUND, 0, 9)
    cells = occupied(x, np.zeros_like(x), level, group_of(kind), 100)
    names = [*(entry["name"] for entry in theme.kinds()), "plain"]
    assert len(names) - 1 == PLAIN
    looks = np.where(cells.level == 0, "ground", np.array(names)[cells.group])
    on_top = np.append(np.diff(cells.cell) > 0, True)
    assert (looks[~on_top] == "ground").all()
    looks = looks[on_top]
    assert dict(zip(kinds, looks.tolist(), strict=True)) == {
        PointKind.MEMBER: "plain",
        PointKind.GROUND: "ground",
        PointKind.STRUCTURE: "structure",
        PointKind.LOW: "low or sparse",
        PointKind.SPARSE: "low or sparse",
        PointKind.OVERHEAD: "overhead",
        PointKind.OUT_OF_RANGE: "plain",
        PointKind.OUT_OF_VIEW: "plain",
        PointKind.FOOT: "plain",
        PointKind.AIRBORNE: "low or sparse",
    }


def test_a_person_under_a_ceiling_is_shown():
    kind = np.array([PointKind.OVERHEAD, PointKind.MEMBER, PointKind.STRUCTURE], np.int8)
    nowhere = np.zeros(3, np.float32)
    cells = occupied(nowhere, nowhere, np.array([30, 17, 20]), group_of(kind), 100)
    assert (cells.level[-1], cells.group[-1]) == (17, PLAIN), "the last one is drawn over the others"
    assert cells.level.tolist() == [30, 20, 17], "and in perspective each is shown at its height"


def test_packed_cells_come_back_with_their_groups():
    cells = Cells(np.array([3, 70_000, 4096**2 - 1]), np.array([0, 63, 9]), np.array([0, 3, 2]))
    for packed, column in zip(pages.looks(packed_cells(cells)), (cells.cell, cells.level, cells.group), strict=True):
        np.testing.assert_array_equal(packed, column)
