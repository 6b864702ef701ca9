"""What the filter is told of a track near its rest position."""

from __future__ import annotations

from modt.tracking import kalman
from modt.tracking.kalman import components_first, tracks_first
from modt.tracking.track_table import TrackTable
from modt.types import Int


class NoStandstill:
    """Nothing: such a track is filtered as any other."""

    def observe(self, tracks: TrackTable, rows: Int) -> None:
        """No effect."""


class Standstill:
    """Its speed is zero, within sigma_mps: the zero-velocity update."""

    def __init__(self, sigma_mps: float) -> None:
        self._sigma_mps = sigma_mps

    def observe(self, tracks: TrackTable, rows: Int) -> None:
        """Update the state of the rows (R,)."""
        x, P = components_first(tracks.x.take(rows, axis=0), tracks.P.take(rows, axis=0))
        tracks.x[rows], tracks.P[rows] = tracks_first(*kalman.observe_speed(x, P, 0.0, self._sigma_mps))


def standstill_of(sigma_mps: float | None) -> Standstill | NoStandstill:
    """The zero-velocity update with a deviation, or none."""
    return NoStandstill() if sigma_mps is None else Standstill(sigma_mps)
