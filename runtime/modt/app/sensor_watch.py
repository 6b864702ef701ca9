"""Whether the sweeps still look as they did, by the cheapest of signs: the number of returns."""

from __future__ import annotations

import numpy as np

from modt.types import Float32

SWEEPS = 10
"""In a row, of another size than before, after which the sensor is looked at again."""
RATIO = 2.0
"""Of the numbers of returns of two sweeps that are of another size."""


class SensorWatch:
    """Compares each sweep with those before."""

    def __init__(self) -> None:
        self._usual: float | None = None
        self._in_a_row = 0

    def unlike(self, points: Float32) -> bool:
        """Whether this is the last of SWEEPS sweeps in a row of another size; from now on that is the usual one."""
        returns = max(int(np.count_nonzero(points[:, 0])), 1)
        if self._usual is None:
            self._usual = returns
        if max(returns / self._usual, self._usual / returns) < RATIO:
            self._usual += 0.01 * (returns - self._usual)
            self._in_a_row = 0
            return False
        self._in_a_row += 1
        if self._in_a_row < SWEEPS:
            return False
        self._usual, self._in_a_row = returns, 0
        return True
