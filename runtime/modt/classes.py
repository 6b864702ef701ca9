"""The table of object classes: everything that is known of a class outside the trained models.

Rows of your own follow the four of modt. They stand in the JSON file that the environment variable MODT_CLASSES names
(docs/own-classes.md). The table is read once, before anything is sized by it, so a class of your own costs a frame no
more than a column.
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
MOST = 65536
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
    """None: neither a vehicle nor a person."""
    VEHICLE = "vehicle"
    """Rigid. Its parts are joined, and it moves like a car."""
    WALKER = "walker"
    """A person on foot, who is never part of a larger object and moves like a pedestrian."""
    RIDER = "rider"
    """A vehicle with a person on it, never part of a larger object. It moves like a cyclist."""


@dataclass(frozen=True, slots=True, kw_only=True)
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


SHIPPED = (
    # Background has the size of a car, because it may be a car that is not recognised yet.
    ClassSpec(
        name="background",
        kind=ClassKind.OTHER,
        kitti=(),
        max_length_m=6.0,
        max_width_m=2.7,
        missed_cost=0.0,
        point_change=0.5,
        colour="#8a8f98",
        usual_m=(4.2, 1.8, 1.6),
        spread_m=(0.45, 0.13, 0.13),
    ),
    ClassSpec(
        name="car",
        kind=ClassKind.VEHICLE,
        kitti=("Car", "Van"),
        labels=("car", "vehicle.car", "REGULAR_VEHICLE", "Pickup Truck", "TYPE_VEHICLE"),
        semantic_kitti=(10, 252),
        autoware=1,
        max_length_m=6.0,
        max_width_m=2.7,
        missed_cost=1.5,
        colour="#2f6fde",
        usual_m=(4.2, 1.8, 1.6),
        spread_m=(0.45, 0.13, 0.13),
    ),
    ClassSpec(
        name="pedestrian",
        kind=ClassKind.WALKER,
        kitti=("Pedestrian", "Person", "Person_sitting"),
        labels=(
            *("human.pedestrian.adult", "human.pedestrian.child", "human.pedestrian.construction_worker"),
            *("human.pedestrian.police_officer", "PEDESTRIAN", "OFFICIAL_SIGNALER", "pedestrian"),
            *("Pedestrian with Object", "TYPE_PEDESTRIAN"),
        ),
        semantic_kitti=(30, 254),
        autoware=7,
        max_length_m=1.1,
        max_width_m=1.1,
        point_change=0.16,
        colour="#d9480f",
        usual_m=(0.65, 0.68, 1.75),
        spread_m=(0.2, 0.12, 0.1),
    ),
    ClassSpec(
        name="cyclist",
        kind=ClassKind.RIDER,
        kitti=("Cyclist",),
        labels=(
            *("vehicle.bicycle", "vehicle.motorcycle", "BICYCLIST", "MOTORCYCLIST", "WHEELED_RIDER", "cyclist"),
            *("Rider", "Motorcycle", "TYPE_CYCLIST"),
        ),
        semantic_kitti=(31, 253),
        autoware=6,
        max_length_m=2.2,
        max_width_m=1.1,
        point_change=0.22,
        colour="#2b8a3e",
        usual_m=(1.8, 0.65, 1.75),
        spread_m=(0.25, 0.12, 0.1),
    ),
)
"""The classes of modt in the order of their values."""
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
    plain: dict[str, Any] = {key: tuple(value) if isinstance(value, list) else value for key, value in row.items()}
    plain |= {"kind": ClassKind(row["kind"]), "kitti": plain["labels"]}
    return ClassSpec(**plain)


def _fits(kind: str, value: Any) -> bool:
    """Whether a value of JSON has an annotated type: a text, a number above zero, or a list of either."""
    if kind.startswith("tuple["):
        of_item, *rest = kind[len("tuple[") : -1].split(", ")
        length_fits = rest == ["..."] or (isinstance(value, list) and len(value) == 1 + len(rest))
        return isinstance(value, list) and length_fits and all(_fits(of_item, item) for item in value)
    if kind == "str":
        return isinstance(value, str) and bool(value)
    if isinstance(value, bool) or not isinstance(value, int if kind == "int" else int | float):
        return False
    return bool(0 <= value < MOST if kind == "int" else 0 < value < MOST)


FILE = os.environ.get(VARIABLE) or None
"""File of the further rows; None without one."""
CLASSES = (*SHIPPED, *(read_rows(Path(FILE)) if FILE else ()))
"""The classes in the order of their indices."""
CLASS_NAMES = tuple(spec.name for spec in CLASSES)
N_CLASSES = len(CLASSES)
PERSON_M = 1.7  # height of a person
OBJECTS = tuple(range(1, N_CLASSES))
"""Index of every class but background."""
