"""Energy of the board, and its measurement."""

from __future__ import annotations

from dataclasses import dataclass, field

from modt.config.base import StageConfig, mechanism, number


@dataclass(frozen=True, slots=True, kw_only=True)
class WindowConfig(StageConfig):
    """Windows between readings of the meters."""

    min_s: float = number(1.0, 0.001, 1e9, "s", "shortest window; RAPL steps in ms, INA chips and batteries average")
    suspend_s: float = number(0.2, 0.001, 60.0, "s", "lead of the boot clock that counts as suspension")
    clock_step_s: float = number(0.5, 0.001, 3600.0, "s", "step of the calendar clock that is marked")


@dataclass(frozen=True, slots=True, kw_only=True)
class EnergyConfig(StageConfig):
    """Power of the board where it is not measured, and the coefficients of its calibration.

    The coefficients are those of a fit over windows: energy = idle_W x time + seg_J x segmentations + class_J x
    classifications + point_J x points classified.
    """

    board: str = field(default="unknown", metadata={"meaning": "name of the board"})
    idle_W: float = number(3.0, 0.0, 1000.0, "W", "power while the process waits")
    busy_W: float = number(7.0, 0.0, 1000.0, "W", "power while it computes on one core")
    meter: str = field(default="none", metadata={"meaning": "meter of the calibration"})
    seg_J: float | None = number(None, -1000.0, 1000.0, "J", "energy of one segmentation")
    class_J: float | None = number(None, -1000.0, 1000.0, "J", "energy of one classification")
    point_J: float | None = number(None, -1000.0, 1000.0, "J", "energy of one point classified")
    windows: WindowConfig = mechanism(WindowConfig)

    @property
    def active_W(self) -> float:
        """Power of one busy core beyond idle [W], equal to mJ/ms."""
        return self.busy_W - self.idle_W

    @property
    def coefficients(self) -> tuple[float, float, float] | None:
        """seg_J, class_J and point_J of a calibration; None unless all three are set."""
        if self.seg_J is None or self.class_J is None or self.point_J is None:
            return None
        return self.seg_J, self.class_J, self.point_J
