"""Configuration of the energy model."""

from __future__ import annotations

from dataclasses import dataclass, field

from modt.config.fields import StageConfig, number


@dataclass(frozen=True, kw_only=True)
class EnergyConfig(StageConfig):
    """Power of the board where no meter is read, and the coefficients that `modt-profile calibrate` finds.

    Energy of a window = idle_W x time + seg_J x segmentations + class_J x classifications + point_J x points.
    """

    board: str = field(default="unknown", metadata={"meaning": "Name of the board in reports."})
    idle_W: float = number(3.0, 0.0, 1000.0, "W", "Power of the board while modt waits.")
    busy_W: float = number(7.0, 0.0, 1000.0, "W", "Power of the board while modt computes on one core.")
    meter: str = field(default="none", metadata={"meaning": "Name of the meter that the calibration read."})
    seg_J: float | None = number(None, -1000.0, 1000.0, "J", "Energy of one segmentation. Null: not calibrated.")
    class_J: float | None = number(
        None, -1000.0, 1000.0, "J", "Energy of one classification, without its points. Null: not calibrated."
    )
    point_J: float | None = number(
        None, -1000.0, 1000.0, "J", "Energy of one point that is classified. Null: not calibrated."
    )

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
