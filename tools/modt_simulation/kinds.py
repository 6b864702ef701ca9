"""Kinds of bodies, by the names of the data sets."""

from __future__ import annotations

from dataclasses import dataclass

from modt.classes import CLASSES, ObjectClass


@dataclass(frozen=True)
class Kind:
    """A kind of body."""

    name: str  # KITTI object type; empty for what is not annotated
    semantic: int  # SemanticKITTI label at rest; 0: that of the material
    moving: int  # SemanticKITTI label in motion; 0: that of the material

    @property
    def object_class(self) -> int:
        """True class: that of the table which has the name, else background."""
        return next((c for c, spec in enumerate(CLASSES) if self.name in spec.kitti), ObjectClass.BACKGROUND)


CAR = Kind("Car", 10, 252)
VAN = Kind("Van", 10, 252)
PEDESTRIAN = Kind("Pedestrian", 30, 254)
SITTER = Kind("Person", 30, 254)
CYCLIST = Kind("Cyclist", 31, 253)
TRUCK = Kind("Truck", 18, 258)
BUS = Kind("Misc", 13, 257)
FORKLIFT = Kind("Forklift", 99, 99)
OTHER = Kind("Misc", 99, 99)
BICYCLE = Kind("", 11, 11)
SCENERY = Kind("", 0, 0)
