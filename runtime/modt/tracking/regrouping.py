"""Regrouping: which proposals, and which part of a proposal, make up the object of each track.

Segmentation cuts a car at the pole before it, and joins a person to the wall that is touched. The tracks know better.
Pairs of a track and a proposal within its known extent are listed once, and serve three steps:

- *Take*: a track takes the larger part of its object from a junior track, which gets the other part.
- *Join*: parts of a car, or of background that may be one, are joined to the proposal of its track. So are new
  proposals beside a car that fit into one car with it: a part that comes into view lies beside what is known.
- *Split*: the track of an object that is expected within a longer proposal takes the points where it is expected, if
  it has no proposal of its own, one that is too long for its class, or one of few points.

The senior of two tracks is that of which more points were seen, not the older one: a fragment begins in the frame in
which its car does, and a bush is older than the car that passes it.

The risk: a person who steps close to a parked car, and is not classified yet, becomes a part of it.
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from modt.class_sizes import IS_PERSON, MAX_CAR_M, MAX_SIZE_M, PART_PERSON, USUAL_CAR_M
from modt.classes import ObjectClass
from modt.geometry import yaw_of
from modt.geometry.kdop import DIRECTIONS, widths
from modt.geometry.kernels import NUMPY_GEOMETRY, GeometryKernels
from modt.observations import Observations, observe
from modt.placement import Placement
from modt.tracking.association import UNMEASURED_M2, Matches
from modt.tracking.kdop_association import POSITION_SIGMA_M
from modt.tracking.track_table import ESTABLISHED_HITS, TrackTable
from modt.types import NONE, Bool, Float64, Int, Proposals

MIN_COVERAGE = 0.45
"""Least part of a proposal within the known extent of a track, or of the expected track within a proposal."""
MIN_PART_COVERAGE = 0.7
"""Least part of a proposal within the known extent of the track that it is joined with."""
LONGER_M = 0.3
"""A joined object exceeds the known extent by at most this; a proposal longer by more holds two objects [m]."""
BESIDE_M = 0.6
"""Greatest gap between a car and a new proposal that is joined with it: more parts, and more neighbours [m]."""
PAD_M = 0.2
"""Margin around the expected extent, and above the expected top, within which points are split off [m]."""
LIKELY = 0.5
"""Probability of its class from which a track leaves its proposal for a piece; less: false people live longer."""
TOUCH_M = 0.05
"""A piece that reaches this near to the margin goes on beyond it: its end there is not known [m]."""
MIN_POINTS, MIN_SHARE = 8, 0.4
"""Least number of points that are split off and that remain; least share of the points last seen."""
MAX_DROP_M = 0.4
"""Greatest distance of the top of a part below the expected top [m]."""
OPPOSITE = np.arange(-4, 4)
"""Direction of a k-DOP that is opposite to each."""


class Associated(NamedTuple):
    """A frame after association."""

    proposals: Proposals
    observations: Observations  # the proposals in the world
    matches: Matches


class Pairs(NamedTuple):
    """Tracks and the proposals that overlap their known extents, by falling seniority of the tracks.

    With them, what is asked of all tracks (M,) and proposals (P,) more than once.
    """

    rows: Int  # (K,) track of each pair
    proposals: Int  # (K,) proposal of each pair
    within: Float64  # (K,) part of the proposal that lies within the known extent
    around: Float64  # (K,) part of the track, as it is expected, that lies within the proposal
    free: Bool  # (K,) the track may take the proposal, and most of one lies within the other
    whole: Bool  # (M,) tracks whose parts are joined: of a hidden person the legs are left, one object
    expected: Float64  # (8, M) k-DOPs of the tracks, where the filter expects them
    extent_m: Float64  # (P,) greatest width of the k-DOP of each proposal


class Pieces(NamedTuple):
    """Objects that are split off longer proposals."""

    rows: Int  # (S,) track of each piece
    hosts: Int  # (S,) proposal that it is split off
    members: Int  # (K,) members of the frame that are split off, ascending
    label: Int  # (K,) piece of each


NO_PIECES = Pieces(*np.zeros((4, 0), np.int64))


class Regrouping:
    """Corrects the grouping of a frame's points by what the tracks know.

    Args:
        kernels: passes over points and pairs.
    """

    def __init__(self, kernels: GeometryKernels = NUMPY_GEOMETRY) -> None:
        self._kernels = kernels

    def regroup(self, tracks: TrackTable, frame: Associated, placement: Placement) -> Associated:
        """The frame in a better grouping; every point stays in one proposal.

        Args:
            tracks: as predicted.
            frame: proposals, observations and matches.
            placement: placement of the frame in the world.
        """
        observations, matches, n = frame.observations, frame.matches, len(frame.proposals)
        if not n or not len(tracks):
            return frame
        own, owner = np.full(len(tracks), NONE), np.full(n, NONE)  # proposal of each track, track of each proposal
        own[matches.rows], owner[matches.proposals] = matches.proposals, matches.rows
        pairs, before = self._pairs(tracks, frame, owner), own.copy()
        _take_larger(tracks, observations, pairs, own, owner)
        into = _join(tracks, observations, pairs, own, owner, self._beside(tracks, observations, pairs, own, owner))
        joined = (into != np.arange(n)).nonzero()[0]
        pieces = _split(tracks, frame, placement, pairs, own)
        rows, hosts = pieces.rows, pieces.hosts
        divided = np.zeros(len(tracks) + 1, np.bool_)  # the last is that of NONE
        divided[owner[hosts]] = True
        lost = owner[joined]
        own[lost[lost != NONE]] = NONE
        own[rows] = n + np.arange(len(rows))
        changed = ((own != before) | divided[:-1]).nonzero()[0]
        if not len(changed) + len(joined):
            return frame
        matches = matches.reassigned(tracks, changed, own[changed])
        if not len(joined) + len(rows):
            return Associated(frame.proposals, observations, matches)
        turn = yaw_of(placement.T_world_sensor)
        yaw, whole = np.concatenate([frame.proposals.box[:, 6], tracks.box[rows, 6] - turn]), into[joined]
        yaw[whole] = tracks.box[owner[whole], 6] - turn  # a part may lie across the car
        index = np.arange(n + len(rows))  # of the proposals, then of the pieces
        source, into = np.concatenate([index[:n], hosts]), np.concatenate([into, index[n:]])
        kept = into == index
        number = (kept.cumsum() - 1)[into]
        renewed = index >= n
        renewed[whole] = renewed[hosts] = True
        new, moved = number[n:], (pieces.members, number[n + pieces.label])
        proposals, observations = self._regrouped(
            frame, placement, number[:n], moved, source[kept], renewed[kept], yaw[kept]
        )
        if len(rows):
            proposals, observations = self._as_expected(tracks, rows, new, proposals, observations, matches)
        return Associated(proposals, observations, matches._replace(proposals=number[matches.proposals]))

    def _pairs(self, tracks: TrackTable, frame: Associated, owner: Int) -> Pairs:
        """Pairs of tracks observed twice and proposals that overlap their known extents."""
        junior = np.arange(len(tracks)) - len(tracks) * tracks.hits * tracks.points  # of two alike the later one
        senior = (tracks.hits > 1).nonzero()[0]
        senior = senior[junior[senior].argsort(kind="stable")]  # faster than by default
        known, kdop, expected = tracks.known_kdops(senior), frame.observations.kdop, tracks.predicted_kdops()
        k, part = self._kernels.overlapping_pairs(known, kdop)
        rows, other = senior[k], owner[part]
        class_, person = tracks.object_class, IS_PERSON[tracks.object_class]
        whole = ~person | tracks.hidden
        one_class = class_[rows] == class_[other]
        one_class |= whole[rows] & ~person[other]  # background and cars are easily confused
        free = (other == NONE) | (other == rows) | (junior[other] > junior[rows]) & one_class
        within = self._kernels.coverage(kdop, known, part, k)
        around = self._kernels.coverage(expected, kdop, rows, part)
        free &= np.maximum(within, around) > MIN_COVERAGE
        return Pairs(rows, part, within, around, free, whole, expected, widths(kdop).max(axis=0))

    def _beside(
        self, tracks: TrackTable, observations: Observations, pairs: Pairs, own: Int, owner: Int
    ) -> tuple[Int, Int]:
        """Proposals of cars (K,) and others (K,) beside them that fit into one car with all that is known of it.

        Such a part belongs to no track, or to a new one of fewer points than the car shows.
        """
        box, kdop, count = observations.box, observations.kdop, observations.count
        cars = ((tracks.object_class == ObjectClass.CAR.value) & (own != NONE)).nonzero()[0]
        new = (tracks.hits < ESTABLISHED_HITS) & ~IS_PERSON[tracks.object_class]
        parts = (new[owner] | (owner == NONE)).nonzero()[0]
        i, j = self._kernels.overlapping_pairs(kdop.take(own[cars], axis=1) + BESIDE_M, kdop.take(parts, axis=1))
        rows, parts = cars[i], parts[j]
        hosts = own[rows]
        near = (hosts != parts) & ((owner[parts] == NONE) | (count[parts] < count[hosts]))
        near &= widths(np.maximum(tracks.known_kdops(rows), kdop.take(parts, axis=1))).max(axis=0) < USUAL_CAR_M[0]
        hosts, parts = hosts[near], parts[near]
        if not len(parts):
            return hosts, parts
        fit = _fit_together(box.take(hosts, axis=0), box.take(parts, axis=0), np.array([USUAL_CAR_M]))
        fit &= ~PART_PERSON.fits(pairs.extent_m[parts], observations.bottom[parts], observations.top[parts])
        return hosts[fit], parts[fit]

    def _regrouped(
        self,
        frame: Associated,
        placement: Placement,
        label: Int,
        moved: tuple[Int, Int],
        source: Int,
        renewed: Bool,
        yaw: Float64,
    ) -> tuple[Proposals, Observations]:
        """Proposals and observations in another grouping.

        Args:
            frame: the grouping before.
            placement: placement of the frame in the world.
            label: (P,) proposal that each becomes, or a part of.
            moved: (S,) members, ascending, that are split off, and the proposal that each goes to.
            source: (Q,) former proposal whose columns each takes over.
            renewed: (Q,) those whose members changed: box and k-DOP come from their points.
            yaw: (Q,) heading of their boxes [rad, sensor frame].
        """
        old, changed, kernels = frame.proposals, renewed.nonzero()[0], self._kernels
        given = old.members, old.coordinates, old.offsets
        members, coordinates, count = kernels.regrouped(*given, label, moved, len(source))
        proposals = old.regrouped(members, coordinates, count, source)
        runs = np.array((proposals.offsets[changed], proposals.offsets[changed + 1]))
        copied = kernels.copy_runs(proposals.members, proposals.coordinates, runs)
        few = proposals.regrouped(*copied, count[changed], changed)
        few = replace(
            few,
            box=kernels.upright_boxes(few.coordinates, few.offsets, yaw[changed]),
            centroid=(kernels.group_sums(few.coordinates, few.offsets) / few.count).T,
        )
        box = proposals.box.copy()
        box[changed] = few.box
        centroid = proposals.centroid.copy()
        centroid[changed] = few.centroid
        observed = observe(few, placement.T_world_sensor, kernels)
        observed = observed.moved(placement.deskew(observed.centroid))
        return (
            replace(proposals, box=box, centroid=centroid),
            frame.observations.regrouped(source, changed, observed),
        )

    def _as_expected(
        self,
        tracks: TrackTable,
        rows: Int,
        pieces: Int,
        proposals: Proposals,
        observations: Observations,
        matches: Matches,
    ) -> tuple[Proposals, Observations]:
        """Proposals and observations whose pieces (S,) show of the tracks (S,) nothing but their positions."""
        kdop, bottom, top = observations.kdop.copy(), observations.bottom.copy(), observations.top.copy()
        kdop[:, pieces] = self._locate(tracks, rows, observations.kdop[:, pieces], matches)
        bottom[pieces], top[pieces] = tracks.bottom[rows], tracks.top[rows]
        reflectance = proposals.reflectance
        if reflectance is not None:
            reflectance = reflectance.copy()
            reflectance[pieces] = np.nan
        return (
            replace(proposals, reflectance=reflectance),
            replace(observations, kdop=kdop, bottom=bottom, top=top),
        )

    def _locate(self, tracks: TrackTable, rows: Int, kdop: Float64, matches: Matches) -> Float64:
        """(8, S) k-DOPs of tracks (S,) whose pieces have (8, S) k-DOPs; writes the measured positions into matches.

        A piece shows where its track is, by the ends at which nothing touches it, and nothing new of its shape.
        """
        x, expected = tracks.x.take(rows, axis=0)[:, :2].T, tracks.predicted_kdops(rows)
        mean = tracks.mean_kdop.T.take(rows, axis=1) + DIRECTIONS.T @ x
        touched, gain = kdop > expected + (PAD_M - TOUCH_M), kdop - mean
        both = touched & touched[OPPOSITE]
        gain = np.where(both, 0.0, np.where(touched, -gain[OPPOSITE], gain))
        before = tracks.end_variance.T.take(rows, axis=1) + both[:4] * UNMEASURED_M2
        shift, covariance, end_variance = self._kernels.measured(mean, mean + gain, POSITION_SIGMA_M**2, before)
        at = (matches.rows == rows[:, None]).argmax(axis=1)
        matches.position[at] += shift
        matches.covariance[at], matches.end_variance[at] = covariance, end_variance.T
        at_measured: Float64 = expected + DIRECTIONS.T @ shift.T
        return at_measured


def _take_larger(tracks: TrackTable, observations: Observations, pairs: Pairs, own: Int, owner: Int) -> None:
    """Let senior tracks take larger parts of their objects: writes own (M,) and owner (P,), each track once."""
    count = observations.count
    size = np.where(own == NONE, 0, count[own])
    larger = (pairs.free & (count[pairs.proposals] > size[pairs.rows])).nonzero()[0]
    rows, parts = pairs.rows[larger], pairs.proposals[larger]
    box = tracks.box.take(rows, axis=0)
    box[:, :2] += tracks.x.take(rows, axis=0)[:, :2] - tracks.anchor.take(rows, axis=0)
    fits = _fit_together(box, observations.box.take(parts, axis=0), MAX_SIZE_M[tracks.object_class[rows]])
    changed: set[int] = set()
    for row, part in zip(rows[fits].tolist(), parts[fits].tolist(), strict=True):
        former, left = int(owner[part]), int(own[row])
        if row in changed or former in changed:
            continue
        own[row], owner[part] = part, row
        changed.add(row)
        if former != NONE:
            own[former] = left
            changed.add(former)
        if left != NONE:
            owner[left] = former


def _join(
    tracks: TrackTable, observations: Observations, pairs: Pairs, own: Int, owner: Int, beside: tuple[Int, Int]
) -> Int:
    """(P,) proposal into which each is joined, itself where it is not; the most senior track is served first.

    `beside` are further pairs of a proposal and its part, served last.
    """
    into, car = np.arange(len(owner)), tracks.object_class == ObjectClass.CAR.value
    host = own[pairs.rows]
    joins = pairs.free & (pairs.within > MIN_PART_COVERAGE) & (host != NONE) & (host != pairs.proposals)
    joins &= (tracks.hits[pairs.rows] >= ESTABLISHED_HITS) & pairs.whole[pairs.rows]
    k = joins.nonzero()[0]
    rows, parts, host = pairs.rows[k], pairs.proposals[k], host[k]
    known = tracks.known_kdops(rows)
    part = observations.kdop.take(parts, axis=1)
    person = PART_PERSON.fits(pairs.extent_m[parts], observations.bottom[parts], observations.top[parts])
    of_car = (owner[parts] != NONE) & car[owner[parts]]
    short = widths(known).max(axis=0, initial=0.0) < MAX_CAR_M
    joins = car[rows] | (short & ~person & ~of_car)
    joins &= (widths(np.maximum(part, observations.kdop.take(host, axis=1))) < widths(known) + LONGER_M).all(axis=0)
    into[beside[1]] = beside[0]
    into[parts[joins][::-1]] = host[joins][::-1]  # the most senior is written last
    whole = into[(into != np.arange(len(into)))]
    into[whole] = whole  # a proposal that gains a part is no part itself
    return into


def _split(tracks: TrackTable, frame: Associated, placement: Placement, pairs: Pairs, own: Int) -> Pieces:
    """Objects that are split off longer proposals: of tracks seen a frame ago that have no proposal, or an odd one.

    A proposal is odd that is too long for the class of the track, or of few points.
    """
    proposals, observations, n = frame.proposals, frame.observations, len(frame.proposals)
    may = (tracks.missed == 0) & (tracks.object_class != ObjectClass.BACKGROUND.value)
    lost = may & (own == NONE)
    held = (may & ~lost).nonzero()[0]
    class_, kept = tracks.object_class[held], own[held]
    odd = pairs.extent_m[kept] > MAX_SIZE_M[class_, 0]
    odd |= observations.count[kept] < MIN_SHARE * tracks.points[held]
    lost[held] = odd & (tracks.posterior[held, class_] >= LIKELY)
    k = (lost[pairs.rows] & (pairs.around > MIN_COVERAGE)).nonzero()[0]
    if not len(k):
        return NO_PIECES
    k = k[pairs.around[k].argsort(kind="stable")]
    rows, hosts = pairs.rows[k], pairs.proposals[k]
    expected_m = widths(pairs.expected.take(rows, axis=1)).max(axis=0)
    longer, best = pairs.extent_m[hosts] > expected_m + LONGER_M, np.full(len(tracks), NONE)
    best[rows[longer]] = hosts[longer]  # the last written covers most
    rows = (best != NONE).nonzero()[0]
    if not len(rows):
        return NO_PIECES
    hosts, top = best[rows], tracks.top[rows]
    count = proposals.count[hosts]
    pair = np.arange(len(rows)).repeat(count)
    member = np.arange(len(pair)) + (proposals.offsets[hosts + 1] - count.cumsum()).repeat(count)
    R, t = placement.T_world_sensor[:3, :3].astype(np.float32), placement.T_world_sensor[:3, 3:]
    xyz = R @ proposals.coordinates.take(member, axis=1) + t
    below = (xyz[2] < top[pair] + PAD_M).nonzero()[0]
    member, pair, xyz = member[below], pair[below], xyz.take(below, axis=1)
    xy = xyz[:2] + placement.deskew(tracks.x.take(rows, axis=0)[:, :2]).T.take(pair, axis=1)
    within = (DIRECTIONS.T @ xy <= (pairs.expected.take(rows[pair], axis=1) + PAD_M)).all(axis=0).nonzero()[0]
    member, first = np.unique(member[within], return_index=True)  # the first of two that expect a point takes it
    pair, z = pair[within[first]], xyz[2, within[first]]
    size, highest = np.bincount(pair, minlength=len(rows)), np.full(len(rows), -np.inf)
    np.maximum.at(highest, pair, z)
    splits = (size >= np.maximum(MIN_POINTS, MIN_SHARE * tracks.points[rows])) & (highest >= top - MAX_DROP_M)
    for these in (own[rows] == hosts, splits):  # a track keeps its proposal if the other pieces leave nothing else
        splits &= ~these | (count - np.bincount(hosts, size * splits, n)[hosts] >= MIN_POINTS)
    split = splits[pair]
    return Pieces(rows[splits], hosts[splits], member[split], (splits.cumsum() - 1)[pair[split]])


def _fit_together(a: Float64, b: Float64, size: Float64) -> Bool:
    """(k,) whether boxes a and b (k, 7) fit into one of size (k, 2) or (1, 2), along the heading of the longer."""
    a, b = a.T.copy(), b.T.copy()  # a contiguous row a column: several times faster for a few boxes
    of_a = a[3] > b[3]
    longer, other = np.where(of_a, a, b), np.where(of_a, b, a)
    yaw, (x, y), half, (length, width) = longer[6], other[:2] - longer[:2], longer[3:5] / 2, other[3:5] / 2
    c, s = np.cos(yaw), np.sin(yaw)
    offset = np.array((x * c + y * s, y * c - x * s))
    turn = yaw - other[6]
    c, s = np.abs(np.cos(turn)), np.abs(np.sin(turn))
    reach = np.array((length * c + width * s, length * s + width * c))  # of the other, along the heading and across
    one, two = np.maximum(half, offset + reach) - np.minimum(-half, offset - reach)
    fit: Bool = (np.maximum(one, two) < size[:, 0]) & (np.minimum(one, two) < size[:, 1])
    return fit
