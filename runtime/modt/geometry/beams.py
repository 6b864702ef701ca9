"""Spacing of a sensor's beams in elevation, where a point is."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from typing import Protocol

import numpy as np

from modt.types import Float32


class Beams(Protocol):
    """Angle between neighbouring beams."""

    def step_rad(self, tangent: Float32) -> Float32:
        """(N,) or () spacing at (N,) elevations, given as rise over horizontal distance [rad]."""


class EvenBeams:
    """The same spacing everywhere."""

    def __init__(self, step_deg: float) -> None:
        self._step_rad: Float32 = np.asarray(np.deg2rad(step_deg), np.float32)

    def step_rad(self, tangent: Float32) -> Float32:
        """() spacing."""
        return self._step_rad


class BeamTable:
    """Spacing from the elevations of all beams: the wider of the gaps above and below the nearest one.

    Args:
        elevations_deg: elevations of two beams or more, in any order.
    """

    CELLS = 1024

    def __init__(self, elevations_deg: Sequence[float]) -> None:
        tangent = np.tan(np.deg2rad(np.unique(elevations_deg)))
        gap = np.diff(np.arctan(tangent))
        wider = np.maximum(np.append(gap[0], gap), np.append(gap, gap[-1]))
        low = tangent[0]
        span = tangent[-1] - low
        self._low = np.float32(low)
        self._scale = np.float32((self.CELLS - 1) / span)
        middle = low + np.arange(self.CELLS) * span / (self.CELLS - 1)
        self._step_rad = wider[np.searchsorted((tangent[1:] + tangent[:-1]) / 2, middle)].astype(np.float32)

    def step_rad(self, tangent: Float32) -> Float32:
        """(N,) spacing at (N,) elevations; above and below all beams that of the outermost."""
        cell = ((tangent - self._low) * self._scale).astype(np.int32)
        step_rad: Float32 = self._step_rad.take(cell, mode="clip")
        return step_rad


@cache
def beams_of(elevations_deg: tuple[float, ...] | None, step_deg: float) -> Beams:
    """Spacing by the elevations of all beams, or the same everywhere where those are not known."""
    return EvenBeams(step_deg) if elevations_deg is None else BeamTable(elevations_deg)
