"""The power model used where no meter can be read."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from modt.energy.meters.meter import Facts, Kind, Measurand, Scope


@dataclass(frozen=True, slots=True)
class ModelMeter:
    """Energy = idle_W x wall time + (busy_W - idle_W) x CPU time of this process.

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
        """Its kind is estimated."""
        return Facts(
            name=model_name(self.idle_W, self.busy_W),
            measurand=Measurand.ENERGY,
            unit="J",
            resolution=1e-9,
            max_W=max(self.idle_W, self.busy_W) * 1024,
            scope=Scope.PROCESS,
            kind=Kind.ESTIMATED,
        )

    def read(self) -> float:
        """Energy since the epoch of the clocks [J]."""
        return 1e-9 * (self.idle_W * self.wall_ns() + (self.busy_W - self.idle_W) * self.cpu_ns())


def model_name(idle_W: float, busy_W: float) -> str:
    """Display name of the model of a board."""
    return f"model {idle_W:g} W idle, {busy_W:g} W busy"
