"""A model where nothing can be read: idle and busy watts, times time."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from modt.energy.meters.meter import Facts, Kind, Quantity, Scope


@dataclass(frozen=True, slots=True)
class ModelMeter:
    """Energy = idle watts x wall time + (busy - idle) watts x CPU time of this process.

    Attributes:
        idle_W: drawn while this process waits.
        busy_W: drawn while it computes on one core.
        wall_ns: monotonic clock [ns].
        cpu_ns: CPU time of this process [ns].
    """

    idle_W: float
    busy_W: float
    wall_ns: Callable[[], int]
    cpu_ns: Callable[[], int]

    @property
    def facts(self) -> Facts:
        """It is an assumption and says so."""
        return Facts(
            name=f"model {self.idle_W:g} W idle, {self.busy_W:g} W busy",
            quantity=Quantity.ENERGY,
            unit="J",
            resolution=1e-9,
            update_s=0.0,
            wrap_J=None,
            max_W=max(self.idle_W, self.busy_W) * 1024,
            scope=Scope.PROCESS,
            kind=Kind.ESTIMATED,
            privilege="none",
        )

    def read(self) -> float:
        """Energy since the clocks' beginning [J]."""
        return 1e-9 * (self.idle_W * self.wall_ns() + (self.busy_W - self.idle_W) * self.cpu_ns())
