"""The table of object classes: everything that is known of a class outside the trained models."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum


class ObjectClass(IntEnum):
    """Class of a proposal; the value is its index in every posterior and in CLASSES."""

    BACKGROUND = 0
    CAR = 1
    PEDESTRIAN = 2
    CYCLIST = 3


@dataclass(frozen=True, slots=True)
class ClassSpec:
    """One class.

    Attributes:
        kitti: KITTI object types that count as the class; results are written as the first.
        semantic_kitti: SemanticKITTI labels that count as the class.
        max_length_m, max_width_m: greatest size of one object, with room for the noise of its outline [m].
        person: whether it is or carries a person, and so is never part of a larger object.
        missed_cost: cost of a missed object, relative to a false one.
        point_change: relative change of the number of points that makes a view independent (alpha of Equation 4).
        colour: in pictures and pages.
        usual_m, spread_m: mean and deviation of length, width and height [m]; of a pedestrian while standing.
    """

    kitti: tuple[str, ...]
    semantic_kitti: tuple[int, ...]
    max_length_m: float
    max_width_m: float
    person: bool
    missed_cost: float
    point_change: float
    colour: str
    usual_m: tuple[float, float, float] = (4.2, 1.8, 1.6)
    spread_m: tuple[float, float, float] = (0.45, 0.13, 0.13)


CLASSES: dict[ObjectClass, ClassSpec] = {
    # Background has the size of a car, because it may be a car that is not recognised yet.
    ObjectClass.BACKGROUND: ClassSpec((), (), 6.0, 2.7, False, 0.0, 0.5, "#8a8f98"),
    ObjectClass.CAR: ClassSpec(("Car", "Van"), (10, 252), 6.0, 2.7, False, 1.5, 0.2, "#2f6fde"),
    ObjectClass.PEDESTRIAN: ClassSpec(
        ("Pedestrian", "Person", "Person_sitting"),
        (30, 254),
        1.1,
        1.1,
        True,
        1.0,
        0.16,
        "#d9480f",
        (0.65, 0.68, 1.75),
        (0.2, 0.12, 0.1),
    ),
    ObjectClass.CYCLIST: ClassSpec(
        ("Cyclist",), (31, 253), 2.2, 1.1, True, 1.0, 0.22, "#2b8a3e", (1.8, 0.65, 1.75), (0.25, 0.12, 0.1)
    ),
}
"""The classes in the order of their values."""

CLASS_NAMES = tuple(c.name.lower() for c in CLASSES)
N_CLASSES = len(CLASSES)
PERSON_M = 1.7  # height of a person
OBJECTS = tuple(CLASSES)[1:]
"""Every class but background."""
