"""Structures and functions as the C sources declare them."""

from __future__ import annotations

import ctypes
from functools import cache
from types import SimpleNamespace

import numpy as np
import pytest

from modt.native import build, declarations
from modt.native.library import ArrayArgument, OutputArgument

SOURCE = """
typedef struct {
    const double *kdop SHAPE(8, n); /* typedef struct { i32 old; } Shapes; */
    double (*box)[7] SHAPE(n, 7);
    i64 *first, *last SHAPE(n);
    float *xy[2] SHAPE(2, k);
    float pad_m;
    uint8_t *known SHAPE(n);
    i32 n;
} Shapes;
EXPORT void modt_forward(const Shapes *s);
EXPORT i64 modt_fit(const Shapes *s, const double (*position)[2], const u4 *points, i64 n, double (*fits)[2],
                    float *best, i64 count[2], void *memory)
{
}
"""


@pytest.fixture
def _source(tmp_path, monkeypatch):
    (tmp_path / "shapes.c").write_text(SOURCE)
    monkeypatch.setattr(build, "FOLDER", tmp_path)
    for name in ("_code", "_bodies", "structure"):  # with caches of their own
        monkeypatch.setattr(declarations, name, cache(getattr(declarations, name).__wrapped__))


@pytest.mark.usefixtures("_source")
def test_members_have_the_types_and_sizes_of_the_declaration():
    members = declarations.structure("Shapes").members
    assert {name: (member.kind, str(member)) for name, member in members.items()} == {
        "kdop": ("array", "float64 (8, n)"),
        "box": ("array", "float64 (n, 7)"),
        "first": ("array", "int64 (n)"),
        "last": ("array", "int64 (n)"),
        "xy": ("rows", "float32 (2, k)"),
        "pad_m": ("number", "float32"),
        "known": ("array", "bool (n)"),
        "n": ("number", "int32"),
    }


@pytest.mark.usefixtures("_source")
def test_functions_have_the_types_of_their_definition():
    library = SimpleNamespace(modt_fit=SimpleNamespace())
    declarations.declare(library, "shapes.c")
    shapes, position, points, n, fits, *written = library.modt_fit.argtypes
    assert library.modt_fit.restype is n is ctypes.c_int64
    assert shapes is declarations.structure("Shapes")
    assert {type(table) for table in (position, points, fits)} == {ArrayArgument}
    position.from_param(np.zeros((1, 2)))
    points.from_param(np.zeros((1, 4), np.float32))
    assert written == [OutputArgument] * 3
