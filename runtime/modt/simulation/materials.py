"""What surfaces are made of: what they return of a pulse, how bright that reads, what SemanticKITTI calls them."""

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
    RETRO = 19
    LAMP = 20


REFLECTIVITY = np.array(
    [
        *(0.34, 0.42, 0.45, 0.6, 0.4, 0.4, 0.3, 0.35, 0.98, 0.4, 0.12),
        *(0.1, 0.08, 0.3, 0.45, 0.35, 0.35, 0.04, 0.15, 0.98, 0.6),
    ],
    np.float32,
)
"""Share of the light returned: it says whether a return is heard."""

LOSS = np.array(
    [0, 0, 0, 0, 0.01, 0.02, 0, 0.04, 0, 0.05, 0.12, 0.72, 0.1, 0.02, 0.01, 0.01, 0.02, 0.2, 0.65, 0, 0], np.float32
)
"""Share of pulses that never come back: mirrored away, let through, or lost in a window on the way."""

LEVEL, SHADE, TEXTURE, GLOSS = np.array(
    [
        (0.30, 0.00, 0.09, 0.00),  # asphalt
        (0.32, 0.00, 0.09, 0.00),  # paving
        (0.36, 0.00, 0.11, 0.00),  # grass
        (0.55, 0.00, 0.12, 0.00),  # paint
        (0.40, 0.10, 0.10, 0.15),  # wall
        (0.38, 0.07, 0.15, 0.10),  # foliage
        (0.28, 0.08, 0.11, 0.15),  # bark
        (0.32, 0.14, 0.12, 0.30),  # metal
        (1.05, 0.20, 0.15, 0.00),  # sign
        (0.41, 0.08, 0.13, 0.50),  # car paint
        (0.21, 0.06, 0.13, 0.45),  # car, dark
        (0.02, 0.00, 0.10, 0.20),  # glass
        (0.05, 0.04, 0.10, 0.10),  # rubber
        (0.43, 0.06, 0.15, 0.25),  # cloth
        (0.40, 0.04, 0.12, 0.15),  # skin
        (0.38, 0.08, 0.12, 0.15),  # wood
        (0.35, 0.00, 0.08, 0.00),  # floor
        (0.14, 0.05, 0.13, 0.35),  # car, black
        (0.00, 0.00, 0.10, 0.00),  # interior
        (1.00, 0.08, 0.15, 0.00),  # retroreflector
        (0.60, 0.20, 0.20, 0.00),  # lamp
    ],
    np.float32,
).T.copy()
"""What a sensor reports: its level head-on and in focus, its spread from body to body and from point to point, and
what is lost of it until a ray grazes. Fitted to the labelled frames of KITTI's object benchmark."""

SEMANTIC = np.array([40, 48, 72, 60, 50, 70, 71, 80, 81, 0, 0, 0, 0, 0, 0, 51, 48, 0, 0, 0, 0], np.uint32)
"""SemanticKITTI class of the material where the body it belongs to has none of its own."""
