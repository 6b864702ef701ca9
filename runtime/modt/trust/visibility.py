"""Visibility by the returns of the air.

A share p of the rays ends in the air on the first L metres. By Beer and Lambert the extinction is -ln(1 - p) / L.
The visibility is ln 20 over it (Koschmieder, a contrast of 5 %).
"""

from __future__ import annotations

import math

import numpy as np

from modt.config import SensorConfig
from modt.trust.tuning import VisibilityTuning
from modt.trust.watch import Finding
from modt.types import Int8, PointKind, TrustLevel

CONTRAST = math.log(20)
"""Extinction times visibility, by definition."""


class VisibilityEstimate:
    """Visibility of a sensor by the returns of the air.

    Args:
        sensor: number of its rays.
        tuning: the estimate, and the bound below which it is reported.

    Attributes:
        visibility_m: meteorological visibility [m], None where it is good or not known.
    """

    def __init__(self, sensor: SensorConfig, tuning: VisibilityTuning = VisibilityTuning()) -> None:
        self.visibility_m: float | None = None
        self._n_rays = sensor.rays_per_turn
        self._tuning = tuning
        self._share = 0.0  # of the rays that end in the air
        self._last_s: float | None = None

    def add(self, kind: Int8 | None, time_s: float) -> None:
        """Add a sweep by the PointKind of its (N,) points and its time [s]."""
        if kind is None or not len(kind):
            return
        elapsed_s = 0.0 if self._last_s is None else max(time_s - self._last_s, 0.0)
        n_returns = len(kind) - int(np.count_nonzero(kind == PointKind.OUT_OF_RANGE.value))
        share = int(np.count_nonzero(kind == PointKind.AIRBORNE.value)) / max(n_returns, self._n_rays)
        gain = 1.0 if self._last_s is None else min(elapsed_s / self._tuning.mean_s, 1.0)
        self._last_s = time_s
        self._share += gain * (share - self._share)
        extinction_per_m = -math.log(1.0 - min(self._share, 0.99)) / self._tuning.depth_m
        is_good = extinction_per_m * self._tuning.most_m < CONTRAST
        self.visibility_m = None if is_good else CONTRAST / extinction_per_m

    def findings(self) -> dict[str, Finding]:
        """Findings about the sweeps, by the name of the check."""
        if self.visibility_m is None or self.visibility_m >= self._tuning.degraded_m:
            return {}
        seen_m = self.visibility_m / 2  # the way there and back leaves 5 % of the light
        cause = f"visibility of about {self.visibility_m:.0f} m: dark things are not seen beyond about {seen_m:.0f} m"
        remedy = "drive so that you stop within that distance, or wait until fog, snow or dust is gone"
        return {"visibility": Finding(TrustLevel.DEGRADED, cause, remedy)}
