"""Clock of a sensor, related to the clock of the host."""

from __future__ import annotations

import math

MAX_DRIFT = 1e-4
"""Greatest drift of a sensor's clock against the host's [s/s]."""
MAX_ERROR_S = 1.0
"""Greatest difference of offsets [s]; beyond it a clock was set, or the sensor was restarted."""
WINDOW_S = 10.0
"""Time in which the least delay is searched that shows whether the host's clock was set [s]."""
STEP_S = 0.02
"""Excess of the least delay of a window over the known one from which the host's clock was set forward [s]."""


class DeviceClock:
    """Follows the least delay between stamp and reception, so that a late reception moves no stamp.

    Attributes:
        offset_s: offset from the unwrapped time of the device to the host's clock [s].
    """

    def __init__(self, wrap_s: float = math.inf) -> None:
        """`wrap_s`: time after which the stamps of the device start over [s]."""
        self.offset_s = 0.0
        self._wrap_s = wrap_s
        self._last_s: float | None = None
        self._window_began_s = 0.0
        self._least_s = math.inf  # least offset in the window

    def unwrapped(self, device_s: float, received_s: float) -> float:
        """Time of the device [s], continuous beyond `wrap_s`, for a stamp received at a time of the host."""
        if self._last_s is None:
            self._last_s = device_s
            self._window_began_s = device_s
            self.offset_s = received_s - device_s
            return device_s
        elapsed_s = math.remainder(device_s - self._last_s, self._wrap_s)
        self._last_s += elapsed_s
        offset_s = received_s - self._last_s
        if abs(offset_s - self.offset_s) > MAX_ERROR_S:
            self.offset_s = offset_s
        else:  # the clocks drift apart slowly, so the offset may grow slowly; a smaller one is a shorter delay
            self.offset_s = min(self.offset_s + MAX_DRIFT * max(elapsed_s, 0.0), offset_s)
        self._least_s = min(self._least_s, offset_s)
        if not 0 <= self._last_s - self._window_began_s < WINDOW_S:
            if self._least_s - self.offset_s > STEP_S:
                self.offset_s = self._least_s
            self._window_began_s = self._last_s
            self._least_s = math.inf
        return self._last_s
