"""Layouts: structures of the C sources as they are filled from Python."""

from __future__ import annotations

import re
from importlib import import_module
from pathlib import Path

import numpy as np
import pytest

import modt
from modt.native import build
from modt.native.library import Array, Layout, Number, Rows

PACKAGE = Path(modt.__file__).parent
C_TYPES = {
    "double": np.float64,
    "float": np.float32,
    "i32": np.int32,
    "int32_t": np.int32,
    "i64": np.int64,
    "int64_t": np.int64,
    "int8_t": np.int8,
    "uint8_t": np.uint8,
}
SHAPES = Layout(
    "Shapes",
    kdop=Array(np.float64, 8, "n"),
    top=Array(np.float32, "n"),
    xy=Rows(np.float32, 2, "k"),
    pad_m=Number(np.float64),
    n=Number(np.int64),
)


def declared_layouts() -> dict[str, Layout]:
    """Layouts of all modules that declare one, by the name of the C structure."""
    layouts = []
    for path in PACKAGE.rglob("*.py"):
        if re.search(r"^\w+ = Layout\(", path.read_text(), re.MULTILINE):
            module = import_module(".".join(("modt", *path.relative_to(PACKAGE).with_suffix("").parts)))
            layouts += [value for value in vars(module).values() if isinstance(value, Layout)]
    return {layout.name: layout for layout in layouts}


def c_structures() -> dict[str, list[tuple[str, str, str, tuple[int, ...]]]]:
    """Members of the structures of the C sources: name, kind, C type and the sizes in brackets."""
    source = "".join(path.read_text() for path in sorted(build.FOLDER.glob("*.[ch]")))
    source = re.sub(r"/\*.*?\*/| SHAPE\(.*?\)", "", source, flags=re.DOTALL)
    structures = {}
    for body, name in re.findall(r"typedef struct \{(.*?)\} (\w+);", source, re.DOTALL):
        members = structures[name] = []
        for declaration in body.split(";")[:-1]:
            c_type, declarators = re.fullmatch(r"\s*(?:const )?(\w+) (.*)", declaration, re.DOTALL).groups()
            for declarator in declarators.split(","):
                star, name_, sizes = re.fullmatch(r"\s*(\(?\*?)(\w+)\)?((?:\[\w+\])*)\s*", declarator).groups()
                kind = "number" if not star else "rows" if star == "*" and sizes else "array"
                members.append((name_, kind, c_type, tuple(map(int, re.findall(r"\d+", sizes)))))
    return structures


def test_layouts_are_those_of_the_c_sources():
    structures = c_structures()
    for name, layout in declared_layouts().items():
        given = structures[name]
        assert [member[0] for member in given] == list(layout.members), name
        for member_name, kind, c_type, sizes in given:
            member = layout.members[member_name]
            dtype = np.dtype(np.uint8) if member.dtype == np.bool_ else member.dtype
            assert (kind, np.dtype(C_TYPES[c_type])) == (member.kind, dtype), f"{name}.{member_name}"
            known = member.shape[:1] if kind == "rows" else member.shape[1:]
            assert not sizes or sizes == known, f"{name}.{member_name}"


def values(n=3, k=4):
    return {
        "kdop": np.zeros((8, n)),
        "top": np.zeros(n, np.float32),
        "xy": np.zeros((2, k), np.float32),
        "pad_m": 0.1,
        "n": n,
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
    other = Layout("Other", n=Number(np.int64))
    with pytest.raises(TypeError, match="a structure Shapes is needed, not Other"):
        SHAPES.from_param(other(n=1))


def test_room_has_the_declared_sizes():
    layout = Layout("Room", cost=Array(np.float64, "rows", 2), next=Array(np.int64, "rows"), rows=Number(np.int64))
    cost, following = layout.allocate(rows=3).arrays
    assert (cost.shape, cost.dtype, following.shape, following.dtype) == ((3, 2), np.float64, (3,), np.int64)
