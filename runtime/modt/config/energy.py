"""The board."""

from __future__ import annotations

from dataclasses import dataclass, field

from modt.config.base import StageConfig, number


@dataclass(frozen=True, slots=True, kw_only=True)
class EnergyConfig(StageConfig):
    """The board: what it draws, assumed where nothing can be measured, and what a calibration found.

    The coefficients are of one window fit: energy = idle_W x time + seg_J x segmentations + class_J x
    classifications + point_J x points classified.
    """

    board: str = field(default="unknown", metadata={"meaning": "what the figures are of"})
    idle_W: float = number(3.0, 0.0, 1000.0, "W", "drawn while the process waits")
    busy_W: float = number(7.0, 0.0, 1000.0, "W", "drawn while it computes on one core")
    meter: str = field(default="none", metadata={"meaning": "that the coefficients were fitted with"})
    seg_J: float | None = number(None, -1000.0, 1000.0, "J", "of one segmentation")
    class_J: float | None = number(None, -1000.0, 1000.0, "J", "of one classification")
    point_J: float | None = number(None, -1000.0, 1000.0, "J", "of one point classified")

    @property
    def active_W(self) -> float:
        """Power of one busy core beyond idle [W], that is mJ a ms."""
        return self.busy_W - self.idle_W

    @property
    def coefficients(self) -> tuple[float, float, float] | None:
        """Those of a calibration [J], None unless there are all three."""
        if self.seg_J is None or self.class_J is None or self.point_J is None:
            return None
        return self.seg_J, self.class_J, self.point_J
