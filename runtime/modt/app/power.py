"""Power and energy of the loop, by the windows of the meters."""

from __future__ import annotations

from typing import Any

from modt.config import EnergyConfig
from modt.energy.attribution import attribute


class Power:
    """What the windows say; unknown until the first one with a reading, and while the meters fail.

    Attributes:
        watts: of the last window.
        kind: measured, integrated, estimated or unavailable.
        frame_J: energy a frame in it.
        stages_J: the same of each stage, of idling and of the rest of the process (`attribute`).
        windows, unread: counts, of all and of those without energy.
    """

    def __init__(self) -> None:
        self.watts: float | None = None
        self.frame_J: float | None = None
        self.stages_J: dict[str, float] = {}
        self.kind = "unavailable"
        self.windows = self.unread = 0

    def add(self, window: dict[str, Any], board: EnergyConfig) -> float | None:
        """Add a line modt.energy/1; the window's power [W]."""
        energy_J, frames = window["energy_J"], window["frames"][2]
        self.windows, self.kind = self.windows + 1, window["kind"]
        self.unread += energy_J is None
        self.watts = None if energy_J is None else energy_J / (1e-9 * window["wall_ns"])
        self.frame_J = None if energy_J is None or not frames else energy_J / frames
        split = attribute(window, board) if frames else {}
        self.stages_J = {stage: joules / frames for stage, joules in split.items()}
        return self.watts

    def report(self) -> dict[str, Any]:
        """Figures for the status."""
        return {
            "watts": self.watts,
            "kind": self.kind,
            "frame_J": self.frame_J,
            "stages_J": {stage: round(joules, 6) for stage, joules in self.stages_J.items()},
            "windows": self.windows,
            "unread_windows": self.unread,
        }
