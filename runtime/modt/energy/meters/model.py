"""The power model used where no meter can be read."""

from __future__ import annotations

from collections.abc import Callable

from modt.energy.meters.meter import Facts, Kind, Meter, Scope


def model_meter(idle_W: float, busy_W: float, wall_ns: Callable[[], int], cpu_ns: Callable[[], int]) -> Meter:
    """A meter that computes the energy of this process by `model_J`.

    Args:
        idle_W: drawn while this process waits.
        busy_W: drawn while it computes on one core.
        wall_ns: monotonic clock.
        cpu_ns: CPU time of this process.
    """
    facts = Facts(
        name=model_name(idle_W, busy_W),
        unit="J",
        resolution=1e-9,
        max_W=max(idle_W, busy_W) * 1024,
        scope=Scope.PROCESS,
        kind=Kind.ESTIMATED,
    )
    return Meter(facts, lambda: model_J(idle_W, busy_W, wall_ns(), cpu_ns()))


def model_J(idle_W: float, busy_W: float, wall_ns: int, cpu_ns: int) -> float:
    """E = P_idle T + (P_busy - P_idle) t of wall time T and CPU time t [J]."""
    return 1e-9 * (idle_W * wall_ns + (busy_W - idle_W) * cpu_ns)


def model_name(idle_W: float, busy_W: float) -> str:
    """Display name of the model of a board."""
    return f"model {idle_W:g} W idle, {busy_W:g} W busy"
