"""Kinds of bodies, as the data sets name them."""

from __future__ import annotations

from dataclasses import dataclass

from modt.classes import ObjectClass


@dataclass(frozen=True, slots=True)
class Kind:
    """A sort of body.

    Attributes:
        name: KITTI's object type; empty for scenery, which is not annotated.
        semantic, moving: SemanticKITTI class standing still and moving; 0 leaves it to the material.
        object_class: what a classifier should say.
    """

    name: str
    semantic: int
    moving: int
    object_class: ObjectClass


CAR = Kind("Car", 10, 252, ObjectClass.CAR)
VAN = Kind("Van", 10, 252, ObjectClass.CAR)
TRUCK = Kind("Truck", 18, 258, ObjectClass.BACKGROUND)
PEDESTRIAN = Kind("Pedestrian", 30, 254, ObjectClass.PEDESTRIAN)
SITTER = Kind("Person_sitting", 30, 254, ObjectClass.PEDESTRIAN)
CYCLIST = Kind("Cyclist", 31, 253, ObjectClass.CYCLIST)
BICYCLE = Kind("", 11, 11, ObjectClass.BACKGROUND)
SCENERY = Kind("", 0, 0, ObjectClass.BACKGROUND)
