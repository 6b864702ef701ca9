"""Optical properties and labels of surface materials."""

from __future__ import annotations

from enum import IntEnum

import numpy as np

from modt.types import Self


class Material(IntEnum):
    """A surface material: its number and its properties, which the tables below name."""

    properties: tuple[float, ...]

    def __new__(cls, *properties: float) -> Self:  # noqa: D102
        number = len(cls.__members__)
        material = int.__new__(cls, number)
        material._value_ = number
        material.properties = properties
        return material

    # reflectivity, dropout, intensity, its sigma by body and by point, grazing loss, label
    ASPHALT = 0.34, 0.00, 0.30, 0.00, 0.09, 0.00, 40
    PAVING = 0.42, 0.00, 0.32, 0.00, 0.09, 0.00, 48
    GRASS = 0.45, 0.00, 0.36, 0.00, 0.11, 0.00, 72
    PAINT = 0.60, 0.00, 0.55, 0.00, 0.12, 0.00, 60
    WALL = 0.40, 0.01, 0.40, 0.10, 0.10, 0.15, 50
    FOLIAGE = 0.40, 0.02, 0.38, 0.07, 0.15, 0.10, 70
    BARK = 0.30, 0.00, 0.28, 0.08, 0.11, 0.15, 71
    METAL = 0.35, 0.04, 0.32, 0.14, 0.12, 0.30, 80
    SIGN = 0.98, 0.00, 1.05, 0.20, 0.15, 0.00, 81
    CAR_PAINT = 0.40, 0.05, 0.41, 0.08, 0.13, 0.50, 0
    CAR_DARK = 0.12, 0.12, 0.21, 0.06, 0.13, 0.45, 0
    GLASS = 0.10, 0.72, 0.02, 0.00, 0.10, 0.20, 0
    RUBBER = 0.08, 0.10, 0.05, 0.04, 0.10, 0.10, 0
    CLOTH = 0.30, 0.02, 0.43, 0.06, 0.15, 0.25, 0
    SKIN = 0.45, 0.01, 0.40, 0.04, 0.12, 0.15, 0
    WOOD = 0.35, 0.01, 0.38, 0.08, 0.12, 0.15, 51
    FLOOR = 0.35, 0.02, 0.35, 0.00, 0.08, 0.00, 48
    CAR_BLACK = 0.04, 0.20, 0.14, 0.05, 0.13, 0.35, 0
    INTERIOR = 0.15, 0.65, 0.00, 0.00, 0.10, 0.00, 0
    RETRO = 0.98, 0.00, 1.00, 0.08, 0.15, 0.00, 0
    LAMP = 0.60, 0.00, 0.60, 0.20, 0.20, 0.00, 0


_TABLE = np.array([material.properties for material in Material], np.float32).T.copy()

REFLECTIVITY = _TABLE[0]
"""Share of the light that a surface returns, which decides whether a return is detected."""
GLOSSY_REFLECTIVITY = REFLECTIVITY.copy()
"""The same where paint mirrors most of the light away. The values were fitted to the shares of rays at visible cars,
20 to 80 m away, that return in labelled frames of KITTI's object benchmark."""
GLOSSY_REFLECTIVITY[[Material.CAR_PAINT, Material.CAR_DARK, Material.CAR_BLACK]] = 0.05, 0.03, 0.015
DROPOUT = _TABLE[1]
"""Share of the pulses that a surface reflects away or transmits."""
INTENSITY = _TABLE[2]
"""Reported intensity at normal incidence in the focus of the optics. This and the next three were fitted to the
labelled frames of KITTI's object benchmark."""
BODY_SIGMA = _TABLE[3]
"""Standard deviation of the intensity from body to body."""
POINT_SIGMA = _TABLE[4]
"""Standard deviation of the intensity from point to point."""
GRAZING_LOSS = _TABLE[5]
"""Intensity that is subtracted at grazing incidence."""
SEMANTIC = _TABLE[6].astype(np.uint32)
"""SemanticKITTI label of a surface whose body has no label of its own."""
