"""Proposals put right by what is known of the tracks: what a frame shows, and what changes it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

from modt.observations import Observations
from modt.odometry.deskew import Placement
from modt.tracking.association import Matches
from modt.tracking.track_table import TrackTable
from modt.types import Proposals


@dataclass(frozen=True, slots=True)
class Found:
    """What a frame shows, and whose it is.

    Attributes:
        proposals: of the frame.
        observations: the proposals in the world.
        matches: those that belong to tracks.
    """

    proposals: Proposals
    observations: Observations
    matches: Matches


class Regrouping(Protocol):
    """Groups the points of a frame's proposals anew."""

    def regroup(self, tracks: TrackTable, found: Found, placement: Placement) -> Found:
        """What was found, put right where something is known better; no point gets lost.

        Args:
            tracks: as predicted.
            found: of the frame.
            placement: by which it was put into the world.
        """
        ...
