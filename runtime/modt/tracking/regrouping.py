"""Regrouping of a frame's proposals by what the tracks know: objects split off, parts merged."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from modt.geometry.kernels import NUMPY_GEOMETRY, GeometryKernels
from modt.observations import Observations, observe
from modt.placement import Placement
from modt.tracking.association import Matches
from modt.tracking.track_table import TrackTable
from modt.types import Float64, Int, Proposals


@dataclass(frozen=True, slots=True)
class Associated:
    """A frame after association.

    Attributes:
        proposals: of the frame.
        observations: the proposals in the world.
        matches: pairs of tracks and proposals.
    """

    proposals: Proposals
    observations: Observations
    matches: Matches


class Regrouping(Protocol):
    """Corrects the grouping of a frame's points."""

    def regroup(self, tracks: TrackTable, frame: Associated, placement: Placement) -> Associated:
        """The frame in a better grouping; every point stays in one proposal.

        Args:
            tracks: as predicted.
            frame: proposals, observations and matches.
            placement: of the frame in the world.
        """
        ...


@dataclass(frozen=True, slots=True)
class Grouping:
    """How P proposals become Q.

    Attributes:
        runs: (2, R) of members in their new order, as for `modt.types.copy_runs`.
        count: (Q,) members of each.
        source: (Q,) proposal whose columns each takes over.
        changed: (C,) those of the Q whose members changed.
        yaw: (C,) heading of their boxes [rad, sensor frame].
    """

    runs: Int
    count: Int
    source: Int
    changed: Int
    yaw: Float64

    def apply(
        self, frame: Associated, placement: Placement, kernels: GeometryKernels = NUMPY_GEOMETRY
    ) -> tuple[Proposals, Observations]:
        """Proposals and observations in the new grouping; boxes and k-DOPs of what changed come from its points."""
        old, changed = frame.proposals, self.changed
        proposals = old.regrouped(
            *kernels.copy_runs(old.members, old.coordinates, self.runs), self.count, self.source
        )
        runs = np.array((proposals.offsets[changed], proposals.offsets[changed + 1]))
        copied = kernels.copy_runs(proposals.members, proposals.coordinates, runs)
        few = proposals.regrouped(*copied, self.count[changed], changed)
        few.box[:] = kernels.upright_boxes(few.coordinates, few.offsets, self.yaw)
        few.centroid[:] = (kernels.group_sums(few.coordinates, few.offsets) / few.count).T
        proposals.box[changed], proposals.centroid[changed] = few.box, few.centroid
        observations = frame.observations.take(self.source)
        observed = observe(few, placement.T_world_sensor, kernels)
        observations.put(changed, observed.moved(placement.deskew(observed.centroid)))
        return proposals, observations


def runs_of(rows: Int) -> Int:
    """(2, R) runs of consecutive numbers among (n,) rows, as for `modt.types.copy_runs`."""
    begin, end = np.ones((2, len(rows)), np.bool_)
    np.not_equal(rows[1:], rows[:-1] + 1, out=begin[1:])
    end[:-1] = begin[1:]
    return np.array((rows[begin], rows[end] + 1))
