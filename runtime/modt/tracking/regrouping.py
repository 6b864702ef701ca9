"""Regrouping: which proposals, and which part of a proposal, make up the object of each track.

Segmentation cuts a car at the pole before it, and joins a person to the wall that is touched. The tracks know better.
Pairs of a track and a proposal that overlaps its known extent are listed once. From them follow three kinds of edits
(plain records, applied later). Takes are applied first. Joins and splits are found from the result, and are applied
together:

- *Take*: a track takes the larger part of its object from a junior track, which gets the other part.
- *Join*: parts of a car or a cyclist, or of background that may be a car, are joined to the proposal of its track. So
  are new proposals beside a car or a cyclist that fit into one with it: a part that comes into view lies beside what
  is known.
- *Split*: the track of an object that is expected within a longer proposal takes the points where it is expected, if
  it has no proposal of its own, one that is too long for its class, or one of few points.

The senior track has the greater product of hits and points of the last proposal. Age would mislead: a fragment is as
old as its car, and a bush is older than the car that passes it.

The joined proposal, all parts included, measures the position of its track.

What is joined does not extend the known extent of its track. Else each join would justify the next, and who leaves a
parked car would be a part of it for metres.

Limit: a person who steps close to a parked car, and is not classified yet, may become a part of it.
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from modt.geometry import yaw_of
from modt.geometry.kernels import NUMPY_GEOMETRY, GeometryKernels
from modt.observations import Observations, observe
from modt.placement import Placement
from modt.tracking.association import Associated, Matches
from modt.tracking.join import Joins, find_joins
from modt.tracking.kdop_association import remeasured_hosts
from modt.tracking.pairs import Situation, with_rows
from modt.tracking.split import Splits, find_splits, locate_pieces
from modt.tracking.take import find_takes
from modt.tracking.track_table import TrackTable
from modt.tracking.tuning import TrackingTuning
from modt.types import NONE, Float64, Int, Proposals


class _Numbering(NamedTuple):
    """Numbers of the proposals after joins and splits: those that remain in their order, then the pieces.

    P former proposals and S pieces become Q proposals.
    """

    of_proposal: Int  # (P,) number that each proposal gets, or the one that it is joined to
    of_piece: Int  # (S,) number of each piece
    source: Int  # (Q,) former proposal whose columns each takes over; that of a piece is the one it is split off
    changed: Int  # (R,) numbers of those whose members changed, ascending; the pieces are the last

    @classmethod
    def after(cls, n: int, joins: Joins, splits: Splits) -> _Numbering:
        """The numbering of n proposals after these edits."""
        remains = np.ones(n, np.bool_)
        remains[joins.parts] = False
        of_proposal = remains.cumsum() - 1
        of_proposal[joins.parts] = of_proposal[joins.hosts]
        n_remaining = n - len(joins.parts)
        of_piece = np.arange(n_remaining, n_remaining + len(splits.rows))
        changed = np.zeros(n_remaining + len(of_piece), np.bool_)
        changed[of_proposal[joins.hosts]] = True
        changed[of_proposal[splits.hosts]] = True
        changed[of_piece] = True
        source = np.concatenate([remains.nonzero()[0], splits.hosts])
        return cls(of_proposal, of_piece, source, changed.nonzero()[0])


class Regrouping:
    """Corrects the grouping of a frame's points by what the tracks know.

    Args:
        kernels: passes over points and pairs.
        tuning: limits of the edits.
    """

    def __init__(self, kernels: GeometryKernels = NUMPY_GEOMETRY, tuning: TrackingTuning = TrackingTuning()) -> None:
        self._kernels = kernels
        self._tuning = tuning.regrouping
        self._position_variance = tuning.kdop_association.position_sigma_m**2

    def regroup(self, tracks: TrackTable, frame: Associated, placement: Placement) -> Associated:
        """The frame in a better grouping; every point stays in one proposal.

        Args:
            tracks: as predicted.
            frame: proposals, observations and matches.
            placement: placement of the frame in the world.
        """
        if not len(frame.proposals) or not len(tracks):
            return frame
        before = Situation.of(tracks, frame, placement, self._kernels, self._tuning)
        after_takes = before._replace(assignment=find_takes(before).applied(before.assignment))
        joins = find_joins(after_takes)
        splits = find_splits(after_takes)
        matches = _matches_after(before, after_takes, frame.matches, joins, splits)
        if not len(joins.parts) + len(splits.rows):
            return frame._replace(matches=matches)
        return self._applied(after_takes, matches, joins, splits)

    def _applied(self, after_takes: Situation, matches: Matches, joins: Joins, splits: Splits) -> Associated:
        """The frame after joins and splits. The matches given number the pieces after the former proposals."""
        tracks = after_takes.tracks
        placement = after_takes.placement
        numbering = _Numbering.after(len(after_takes.proposals), joins, splits)
        changed = numbering.changed
        proposals = self._regrouped(after_takes.proposals, splits, numbering)
        yaw = proposals.box[:, 6].copy()
        turn = yaw_of(placement.T_world_sensor)
        yaw[numbering.of_piece] = tracks.box[splits.rows, 6] - turn
        # A host has the heading of its track, since a part may lie across the car.
        rows_of_hosts = after_takes.assignment.track_of_proposal[joins.hosts]
        yaw[numbering.of_proposal[joins.hosts]] = tracks.box[rows_of_hosts, 6] - turn
        changed_only = self._reboxed(proposals, yaw[changed], changed)
        observed = observe(changed_only, placement.T_world_sensor, self._kernels)
        # The bearing of the centroid says when a proposal was seen. The odometry does the same, except across the
        # seam of the sweep, where it averages over the bearings of the box.
        observed = observed.moved(placement.deskew(observed.centroid))
        if len(splits.rows):
            observed, matches = self._with_pieces(after_takes, splits, observed, matches)
        number = np.concatenate([numbering.of_proposal, numbering.of_piece])
        # The reflectance of single points is not known here. A host keeps its statistics, though it gained or lost
        # points; those of a piece are unknown, since it is another object. Flags and ground come from the source.
        reflectance = proposals.reflectance
        regrouped = Associated(
            proposals=replace(
                proposals,
                box=with_rows(proposals.box, changed, changed_only.box),
                centroid=with_rows(proposals.centroid, changed, changed_only.centroid),
                reflectance=None if reflectance is None else with_rows(reflectance, numbering.of_piece, np.nan),
            ),
            observations=after_takes.observations.regrouped(numbering.source, changed, observed),
            matches=matches._replace(proposals=number[matches.proposals]),
            joined=rows_of_hosts,
        )
        if not len(rows_of_hosts):
            return regrouped
        remeasured = remeasured_hosts(tracks, regrouped, self._kernels, self._position_variance)
        return regrouped._replace(matches=remeasured)

    def _regrouped(self, former: Proposals, splits: Splits, numbering: _Numbering) -> Proposals:
        """Proposals of the members in their new order; boxes and other columns are those of their sources."""
        members, coordinates, count = self._kernels.sort_members(
            former.members,
            former.coordinates,
            former.offsets,
            numbering.of_proposal,
            (splits.member_rows, numbering.of_piece[splits.piece]),
            len(numbering.source),
        )
        return former.regrouped(members, coordinates, count, numbering.source)

    def _reboxed(self, proposals: Proposals, yaw: Float64, changed: Int) -> Proposals:
        """The proposals (R,) whose members changed, alone: boxes at headings (R,) and centroids of their points."""
        kernels = self._kernels
        runs = np.array((proposals.offsets[changed], proposals.offsets[changed + 1]))
        members, coordinates = kernels.copy_runs(proposals.members, proposals.coordinates, runs)
        changed_only = proposals.regrouped(members, coordinates, proposals.count[changed], changed)
        box = kernels.upright_boxes(changed_only.coordinates, changed_only.offsets, yaw)
        centroid = (kernels.group_sums(changed_only.coordinates, changed_only.offsets) / changed_only.count).T
        return replace(changed_only, box=box, centroid=centroid)

    def _with_pieces(
        self, after_takes: Situation, splits: Splits, observed: Observations, matches: Matches
    ) -> tuple[Observations, Matches]:
        """Observations (R,) and matches in which the pieces, the last rows, measure the positions of their tracks.

        Replace the k-DOP, bottom and top of the pieces by those of their tracks, since a piece measures a position
        only. Box, centroid and count are those of its points.
        """
        rows = splits.rows
        pieces = np.arange(len(observed) - len(rows), len(observed))
        kdop = observed.kdop.copy()
        kdop[:, pieces], matches = locate_pieces(after_takes, rows, kdop[:, pieces], matches, self._position_variance)
        bottom = with_rows(observed.bottom, pieces, after_takes.tracks.bottom[rows])
        top = with_rows(observed.top, pieces, after_takes.tracks.top[rows])
        return replace(observed, kdop=kdop, bottom=bottom, top=top), matches


def _matches_after(
    before: Situation, after_takes: Situation, matches: Matches, joins: Joins, splits: Splits
) -> Matches:
    """The matches after all edits; pieces are numbered after the former proposals.

    A track whose proposal is new to it, or loses points to another track, gets no measurement from it here. The
    pieces are measured later, by `locate_pieces`.
    """
    proposal_of_track = after_takes.assignment.proposal_of_track.copy()
    track_of_proposal = after_takes.assignment.track_of_proposal
    loses_all = track_of_proposal[joins.parts]
    proposal_of_track[loses_all[loses_all != NONE]] = NONE
    n = len(track_of_proposal)
    proposal_of_track[splits.rows] = np.arange(n, n + len(splits.rows))
    changed = proposal_of_track != before.assignment.proposal_of_track
    loses_points = track_of_proposal[splits.hosts]
    changed[loses_points[loses_points != NONE]] = True
    rows = changed.nonzero()[0]
    return matches.reassigned(before.tracks, rows, proposal_of_track[rows]) if len(rows) else matches
