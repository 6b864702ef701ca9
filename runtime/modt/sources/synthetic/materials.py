"""What surfaces are made of: how bright they are, how often they swallow a pulse, what SemanticKITTI calls them."""

from __future__ import annotations

from enum import IntEnum

import numpy as np


class Material(IntEnum):
    """Row in the tables below."""

    ASPHALT = 0
    PAVING = 1
    GRASS = 2
    PAINT = 3
    WALL = 4
    FOLIAGE = 5
    BARK = 6
    METAL = 7
    SIGN = 8
    CAR_PAINT = 9
    CAR_DARK = 10
    GLASS = 11
    RUBBER = 12
    CLOTH = 13
    SKIN = 14
    WOOD = 15
    FLOOR = 16
    CAR_BLACK = 17
    INTERIOR = 18


REFLECTIVITY = np.array(
    [0.34, 0.42, 0.45, 0.6, 0.4, 0.4, 0.3, 0.35, 0.98, 0.4, 0.12, 0.1, 0.08, 0.3, 0.45, 0.35, 0.35, 0.04, 0.15],
    np.float32,
)
"""Share of the light returned."""

LOSS = np.array(
    [0, 0, 0, 0, 0.01, 0.02, 0, 0.04, 0, 0.05, 0.12, 0.72, 0.1, 0.02, 0.01, 0.01, 0.02, 0.2, 0.65], np.float32
)
"""Share of pulses that never come back: mirrored away, let through, or lost in a window on the way."""

SEMANTIC = np.array([40, 48, 72, 60, 50, 70, 71, 80, 81, 0, 0, 0, 0, 0, 0, 51, 48, 0, 0], np.uint32)
"""SemanticKITTI class of the material where the body it belongs to has none of its own."""
