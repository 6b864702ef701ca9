"""The table of object classes: everything that is known of a class outside the trained models.

The four of modt stand in classes.json. Rows of your own follow them, in the same form, from the JSON file that the
environment variable MODT_CLASSES names (docs/own-classes.md). The table is read once, before anything is sized by it,
so a class of your own costs a frame no more than a column.
"""

from __future__ import annotations

import json
import os
import re
from collections.abc import Mapping
from dataclasses import MISSING, dataclass, fields
from enum import Enum, IntEnum
from pathlib import Path
from typing import Any

from modt.errors import MisuseError

VARIABLE = "MODT_CLASSES"
"""Environment variable with the file of further rows."""
LIMIT = 65536
"""Every number of a row is below it."""
MOST_ROWS = 16
"""Greatest number of further rows."""


class ObjectClass(IntEnum):
    """The classes of modt; the value is the index in every posterior and in CLASSES."""

    BACKGROUND = 0
    CAR = 1
    PEDESTRIAN = 2
    CYCLIST = 3


class ClassKind(Enum):
    """The rules that a class is subject to."""

    OTHER = "other"
    """No rules: neither a vehicle nor a person."""
    VEHICLE = "vehicle"
    """Rigid. Its parts are joined, and it moves like a car."""
    WALKER = "walker"
    """A person on foot, who is never part of a larger object and moves like a pedestrian."""
    RIDER = "rider"
    """A vehicle with a person on it, never part of a larger object. It moves like a cyclist."""


@dataclass(frozen=True, kw_only=True)
class ClassSpec:
    """One class.

    Attributes:
        name: lower case.
        kind: the rules that it is subject to.
        kitti: KITTI object types that count as the class; results are written as the first.
        labels: names in other data sets that count as the class.
        semantic_kitti: SemanticKITTI labels that count as the class, at rest and in motion.
        autoware: label of autoware_perception_msgs/ObjectClassification.
        max_length_m, max_width_m: greatest size of one object, with room for the noise of its outline [m].
        missed_cost: cost of a missed object, relative to a false one.
        point_change: relative change of the number of points that makes a view independent (alpha of Equation 4).
        colour: in pictures and pages.
        usual_m, spread_m: mean and deviation of length, width and height [m]; of a pedestrian while standing.
    """

    name: str
    kind: ClassKind
    kitti: tuple[str, ...]
    labels: tuple[str, ...] = ()
    semantic_kitti: tuple[int, ...] = ()
    autoware: int = 0
    max_length_m: float
    max_width_m: float
    missed_cost: float = 1.0
    point_change: float = 0.2
    colour: str = "#7048e8"
    usual_m: tuple[float, float, float]
    spread_m: tuple[float, float, float]

    @property
    def person(self) -> bool:
        """Whether it is or carries a person, and so is never part of a larger object."""
        return self.kind in (ClassKind.WALKER, ClassKind.RIDER)


def _spec(row: Mapping[str, Any]) -> ClassSpec:
    """Class of a row of JSON. The keys are the attributes of `ClassSpec`; `kitti` defaults to `labels`."""
    plain: dict[str, Any] = {key: tuple(value) if isinstance(value, list) else value for key, value in row.items()}
    return ClassSpec(**{"kitti": plain.get("labels"), **plain, "kind": ClassKind(row["kind"])})


SHIPPED = tuple(map(_spec, json.loads(Path(__file__).with_suffix(".json").read_bytes())))
"""The classes of modt in the order of their values. Background has the size of a car: it may be one, unrecognised."""
N_SHIPPED = len(SHIPPED)


def read_rows(path: Path) -> tuple[ClassSpec, ...]:
    """The rows of a JSON file: a list of objects whose keys are the attributes of `ClassSpec`, without `kitti`.

    `labels` names the class in data sets of any kind, and results in KITTI's format are written as the first.

    Raises:
        MisuseError: unreadable, no such list, or a row is not as it should be.
    """
    try:
        found = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError) as error:
        raise MisuseError(path, f"cannot be read ({error})", "write a JSON list of classes") from None
    if not isinstance(found, list) or not found or len(found) > MOST_ROWS:
        raise MisuseError(path, "is no list of classes", f"write a JSON list of 1 to {MOST_ROWS} classes")
    rows: list[ClassSpec] = []
    for number, row in enumerate(found):
        taken = {spec.name for spec in (*SHIPPED, *rows)} | {"other", "unknown_near"}
        rows.append(_row(row, taken, f"{path}: class {number + 1}"))
    return tuple(rows)


def _row(row: Any, taken: set[str], place: str) -> ClassSpec:
    """One row of a file; `taken` are the names that it must not have."""
    form = {f.name: f for f in fields(ClassSpec) if f.name != "kitti"}
    wanted = [name for name, f in form.items() if f.default is MISSING] + ["labels"]
    if not isinstance(row, Mapping) or not set(wanted) <= row.keys() <= form.keys():
        raise MisuseError(
            place, "does not have the right keys", f"give {', '.join(wanted)}; known: {', '.join(form)}"
        )
    name = row["name"]
    if not isinstance(name, str) or not re.fullmatch("[a-z][a-z0-9_]*", name) or name in taken:
        raise MisuseError(place, f"name {name!r} is taken, or no lower-case word", "give another name")
    kinds = [kind.value for kind in ClassKind]
    if row["kind"] not in kinds:
        raise MisuseError(place, f"kind {row['kind']!r} is unknown", f"use one of {', '.join(kinds)}")
    for key, value in row.items():
        if key != "kind" and (value == [] or not _fits(str(form[key].type), value)):
            raise MisuseError(place, f"{key} {value!r} is no {form[key].type}", "correct it")
    return _spec(row)


def _fits(kind: str, value: Any) -> bool:
    """Whether a value of JSON has an annotated type: a text, a number above zero, or a list of either.

    `kind` is the text of an annotation of `ClassSpec`, which `from __future__ import annotations` keeps as text.
    """
    if kind.startswith("tuple["):
        of_item, *rest = kind[len("tuple[") : -1].split(", ")
        length_fits = rest == ["..."] or (isinstance(value, list) and len(value) == 1 + len(rest))
        return isinstance(value, list) and length_fits and all(_fits(of_item, item) for item in value)
    if kind == "str":
        return isinstance(value, str) and bool(value)
    if isinstance(value, bool) or not isinstance(value, int if kind == "int" else int | float):
        return False
    return bool(0 <= value < LIMIT if kind == "int" else 0 < value < LIMIT)


FILE = os.environ.get(VARIABLE) or None
"""File of the further rows; None without one."""
CLASSES = (*SHIPPED, *(read_rows(Path(FILE)) if FILE else ()))
"""The classes in the order of their indices."""
CLASS_NAMES = tuple(spec.name for spec in CLASSES)
N_CLASSES = len(CLASSES)
"""Number of classes, background first; C in the shapes of arrays."""
PERSON_HEIGHT_M = 1.7
"""Height of a person [m]."""
OBJECTS = tuple(range(1, N_CLASSES))
"""Index of every class but background."""
