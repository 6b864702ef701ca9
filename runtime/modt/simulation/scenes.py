"""The scenes there are."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from modt.simulation.crossing import crossing
from modt.simulation.street import street
from modt.simulation.world import World
from modt.simulation.yard import hall, yard

SCENES: dict[str, Callable[[np.random.Generator, float, float], World]] = {
    "street": street,
    "crossing": crossing,
    "yard": yard,
    "hall": hall,
}
"""Scene by name: made of a random generator, a duration [s] and the height of the sensor [m]."""
