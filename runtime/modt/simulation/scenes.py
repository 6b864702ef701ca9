"""Table of the scenes."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from modt.simulation.crossing import crossing
from modt.simulation.street import street
from modt.simulation.world import World
from modt.simulation.yard import hall, yard

SCENES: dict[str, Callable[[np.random.Generator, float, float], World]] = {
    scene.__name__: scene for scene in (street, crossing, yard, hall)
}
"""Scene by name: a function of a random generator, a duration [s] and the height of the sensor [m]."""
