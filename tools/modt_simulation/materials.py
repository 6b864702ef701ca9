"""Optical properties and labels of surface materials."""

from __future__ import annotations

from enum import IntEnum

import numpy as np

from modt.types import Self


class Material(IntEnum):
    """Index of a material, with its properties."""

    properties: tuple[float, ...]

    def __new__(cls, index: int, *properties: float) -> Self:  # noqa: D102
        material = int.__new__(cls, index)
        material._value_, material.properties = index, properties
        return material

    # reflectivity, dropout, intensity, its sigma by body and by point, grazing loss, label
    ASPHALT = 0, 0.34, 0.00, 0.30, 0.00, 0.09, 0.00, 40
    PAVING = 1, 0.42, 0.00, 0.32, 0.00, 0.09, 0.00, 48
    GRASS = 2, 0.45, 0.00, 0.36, 0.00, 0.11, 0.00, 72
    PAINT = 3, 0.60, 0.00, 0.55, 0.00, 0.12, 0.00, 60
    WALL = 4, 0.40, 0.01, 0.40, 0.10, 0.10, 0.15, 50
    FOLIAGE = 5, 0.40, 0.02, 0.38, 0.07, 0.15, 0.10, 70
    BARK = 6, 0.30, 0.00, 0.28, 0.08, 0.11, 0.15, 71
    METAL = 7, 0.35, 0.04, 0.32, 0.14, 0.12, 0.30, 80
    SIGN = 8, 0.98, 0.00, 1.05, 0.20, 0.15, 0.00, 81
    CAR_PAINT = 9, 0.40, 0.05, 0.41, 0.08, 0.13, 0.50, 0
    CAR_DARK = 10, 0.12, 0.12, 0.21, 0.06, 0.13, 0.45, 0
    GLASS = 11, 0.10, 0.72, 0.02, 0.00, 0.10, 0.20, 0
    RUBBER = 12, 0.08, 0.10, 0.05, 0.04, 0.10, 0.10, 0
    CLOTH = 13, 0.30, 0.02, 0.43, 0.06, 0.15, 0.25, 0
    SKIN = 14, 0.45, 0.01, 0.40, 0.04, 0.12, 0.15, 0
    WOOD = 15, 0.35, 0.01, 0.38, 0.08, 0.12, 0.15, 51
    FLOOR = 16, 0.35, 0.02, 0.35, 0.00, 0.08, 0.00, 48
    CAR_BLACK = 17, 0.04, 0.20, 0.14, 0.05, 0.13, 0.35, 0
    INTERIOR = 18, 0.15, 0.65, 0.00, 0.00, 0.10, 0.00, 0
    RETRO = 19, 0.98, 0.00, 1.00, 0.08, 0.15, 0.00, 0
    LAMP = 20, 0.60, 0.00, 0.60, 0.20, 0.20, 0.00, 0


_TABLE = np.array([material.properties for material in Material], np.float32).T.copy()

REFLECTIVITY, DROPOUT = _TABLE[:2]
"""Share of the light that is returned, which decides on detection; share of pulses reflected away or transmitted."""

INTENSITY, BODY_SIGMA, POINT_SIGMA, GRAZING_LOSS = _TABLE[2:6]
"""Reported intensity at normal incidence in the focus, its standard deviation from body to body and from point to
point, and what is subtracted at grazing incidence. Fitted to the labelled frames of KITTI's object benchmark."""

SEMANTIC = _TABLE[6].astype(np.uint32)
"""SemanticKITTI label of the material of bodies without one of their own."""
