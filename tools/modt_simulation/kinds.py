"""Kinds of bodies, by the names of the data sets."""

from __future__ import annotations

from dataclasses import dataclass

from modt.classes import CLASSES, ObjectClass


@dataclass(frozen=True, slots=True)
class Kind:
    """A kind of body."""

    name: str  # KITTI object type; empty for what is not annotated
    semantic: int  # SemanticKITTI label at rest; 0: that of the material
    moving: int  # SemanticKITTI label in motion; 0: that of the material
    object_class: ObjectClass = ObjectClass.BACKGROUND  # true class


def _of_class(object_class: ObjectClass, row: int = 0) -> Kind:
    """The kind of one of the KITTI object types that the class table lists for a class."""
    spec = CLASSES[object_class]
    semantic, moving = spec.semantic_kitti
    return Kind(spec.kitti[row], semantic, moving, object_class)


CAR = _of_class(ObjectClass.CAR)
VAN = _of_class(ObjectClass.CAR, 1)
PEDESTRIAN = _of_class(ObjectClass.PEDESTRIAN)
SITTER = _of_class(ObjectClass.PEDESTRIAN, 1)
CYCLIST = _of_class(ObjectClass.CYCLIST)
TRUCK = Kind("Truck", 18, 258)
BUS = Kind("Misc", 13, 257)
OTHER = Kind("Misc", 99, 99)
BICYCLE = Kind("", 11, 11)
SCENERY = Kind("", 0, 0)
