"""The scenes there are."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from modt.sources.synthetic.street import street
from modt.sources.synthetic.world import World

SCENES: dict[str, Callable[[np.random.Generator, float, float], World]] = {"street": street}
"""Scene by name: made of a random generator, a duration [s] and the height of the sensor [m]."""
