"""Stamps of a sensor's clock on the clock of the host."""

from __future__ import annotations

import math

MAX_DRIFT = 1e-4
"""Of a sensor's clock against the host's [s/s]."""
MAX_ERROR_S = 1.0
"""A greater difference is a clock that was set, or a sensor that was switched on again."""


WINDOW_S, STEP_S = 10.0, 0.02
"""Where even the least delay of so long is longer than the one known by so much, the host's clock was set forward."""


class DeviceClock:
    """Follows the least delay between stamp and reception, so that a late reception moves no stamp.

    Attributes:
        offset_s: of the host's clock to the unwrapped time of the device [s].
    """

    def __init__(self, wrap_s: float = math.inf) -> None:
        """`wrap_s`: time after which the stamps of the device begin again."""
        self.offset_s = 0.0
        self._wrap_s = wrap_s
        self._last_s: float | None = None
        self._since_s, self._least_s = 0.0, math.inf  # begin of a window, and the least offset in it

    def unwrapped(self, device_s: float, received_s: float) -> float:
        """Time of the device [s], continuous beyond wrap_s, of a stamp received at a time of the host."""
        if self._last_s is None:
            self._last_s, self._since_s, self.offset_s = device_s, device_s, received_s - device_s
            return device_s
        elapsed_s = device_s - self._last_s
        if self._wrap_s < math.inf:
            elapsed_s = math.remainder(elapsed_s, self._wrap_s)
        self._last_s += elapsed_s
        offset_s = received_s - self._last_s
        if abs(offset_s - self.offset_s) > MAX_ERROR_S:
            self.offset_s = offset_s
        else:
            self.offset_s = min(self.offset_s + MAX_DRIFT * max(elapsed_s, 0.0), offset_s)
        self._least_s = min(self._least_s, offset_s)
        if not 0 <= self._last_s - self._since_s < WINDOW_S:
            if self._least_s - self.offset_s > STEP_S:
                self.offset_s = self._least_s
            self._since_s, self._least_s = self._last_s, math.inf
        return self._last_s
