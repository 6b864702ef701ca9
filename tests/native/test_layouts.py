"""Layouts: structures of the C sources as they are filled from Python."""

from __future__ import annotations

import re

import numpy as np
import pytest

from modt.native.library import Layout, Member

NUMBER = Member("number", np.dtype(np.int64))
SHAPES = Layout(
    "Shapes",
    kdop=Member("array", np.dtype(np.float64), (8, "n")),
    top=Member("array", np.dtype(np.float32), ("n",)),
    xy=Member("rows", np.dtype(np.float32), (2, "k")),
    pad_m=Member("number", np.dtype(np.float64)),
    n=NUMBER,
)


def values():
    return {
        "kdop": np.zeros((8, 3)),
        "top": np.zeros(3, np.float32),
        "xy": np.zeros((2, 4), np.float32),
        "pad_m": 0.1,
        "n": 3,
    }


def test_a_structure_holds_addresses_and_numbers_in_the_order_of_its_declaration():
    given = values()
    fields = np.frombuffer(SHAPES(**dict(reversed(given.items()))), np.int64)
    addresses = [given["kdop"].ctypes.data, given["top"].ctypes.data, *(row.ctypes.data for row in given["xy"])]
    assert fields[:4].tolist() == addresses
    assert fields[4:5].view(np.float64) == 0.1
    assert fields[5] == 3


@pytest.mark.parametrize(
    ("change", "error", "message"),
    [
        ({"bottom": np.zeros(3)}, TypeError, "Shapes.bottom is unknown"),
        ({"top": np.zeros(3)}, TypeError, "Shapes.top, float32 (n), is of float64"),
        ({"top": [0.0] * 3}, TypeError, "Shapes.top, float32 (n), is of list"),
        ({"kdop": np.zeros((3, 8)).T}, TypeError, "Shapes.kdop, float64 (8, n), is not contiguous"),
        ({"kdop": np.zeros((4, 3))}, ValueError, "Shapes.kdop, float64 (8, n), has the shape (4, 3)"),
        ({"kdop": np.zeros(24)}, TypeError, "Shapes.kdop, float64 (8, n), has 1 axes"),
        ({"xy": np.zeros((3, 4), np.float32)}, ValueError, "Shapes.xy, float32 (2, k), has the shape (3, 4)"),
        ({"top": np.zeros(2, np.float32)}, ValueError, "Shapes.top, float32 (n), has the shape (2,), where {'n': 3"),
        ({"n": 4}, ValueError, "Shapes.kdop, float64 (8, n), has the shape (8, 3), where {'n': 4"),
        ({"n": 3.0}, TypeError, "Shapes.n, int64, is 3.0"),
        ({"pad_m": "much"}, TypeError, "Shapes.pad_m, float64, is 'much'"),
    ],
)
def test_a_member_that_does_not_fit_is_named(change, error, message):
    with pytest.raises(error, match=re.escape(message)):
        SHAPES(**values() | change)


def test_a_missing_member_and_another_structure_are_refused():
    given = values()
    del given["top"]
    with pytest.raises(TypeError, match=r"Shapes\.top is missing"):
        SHAPES(**given)
    other = Layout("Other", n=NUMBER)
    with pytest.raises(TypeError, match="a structure Shapes is needed, not Other"):
        SHAPES.from_param(other(n=1))


def test_room_has_the_declared_sizes():
    cost = Member("array", np.dtype(np.float64), ("rows", 2))
    following = Member("array", np.dtype(np.int64), ("rows",))
    layout = Layout("Room", cost=cost, next=following, rows=NUMBER)
    room = layout.allocate(rows=3).arrays
    assert [(array.shape, array.dtype) for array in room] == [((3, 2), np.float64), ((3,), np.int64)]
