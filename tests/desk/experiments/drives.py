"""Small drives for experiments."""

from __future__ import annotations

from modt_desk.experiments.drives import SimulatedDrive, simulated_drives


def short_drives(n: int = 2, frames: int = 4) -> list[SimulatedDrive]:
    """Simulated ones."""
    return simulated_drives(n, frames / 10)
