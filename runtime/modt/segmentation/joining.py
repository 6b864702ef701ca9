"""Joining: merge the proposals of several sensors, so that an object seen by several gets one proposal.

Each sensor is segmented by itself, since the ground, the clusters and what rays pass follow from the order of its
beams. Each proposal then joins the proposal of another sensor with which it shares more cells than with any other.
What one sensor keeps apart, such as a person and the car beside them, stays apart unless another sees it as one.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from typing import NamedTuple

import numpy as np

from modt.segmentation.kernels import Kernels
from modt.segmentation.tuning import JoiningTuning
from modt.types import N_REFLECTANCE, Float64, Int, Int8, Proposals

_NEIGHBOURS = [(i, k) for i in (-1, 0, 1) for k in (-1, 0, 1)]
"""Steps to a cell and its eight neighbours."""
_STRIDE = np.int64(1) << 32
"""Step of the number of a cell along x, beyond all cells along y."""
_NO_ROWS = np.zeros(0, np.int64)


@dataclass(frozen=True)
class SensorProposals:
    """View of a frame by one sensor.

    Attributes:
        proposals: in the common frame; their members are rows of the sensor's own points.
        beam_sr: (P,) solid angle of a point of each, as seen from the origin of the common frame [sr].
        n_points: points of the sensor.
    """

    proposals: Proposals
    beam_sr: Float64
    n_points: int


def join(views: Sequence[SensorProposals], kernels: Kernels, tuning: JoiningTuning = JoiningTuning()) -> Proposals:
    """One set of proposals of the points of all sensors, one sensor after the other."""
    if not views:
        return Proposals.empty(np.zeros(0, np.int8))
    side_by_side = _side_by_side(views)
    sensor = np.repeat(np.arange(len(views)), [len(view.proposals) for view in views])
    group = _groups(len(side_by_side), _partners(side_by_side, sensor, tuning))
    if len(group) == 0 or group.max() + 1 == len(group):
        return side_by_side.lock()
    return _joined(side_by_side, sensor, group, kernels).lock()


def _side_by_side(views: Sequence[SensorProposals]) -> Proposals:
    """The proposals of all sensors, none of them joined."""
    parts = [view.proposals for view in views]
    first_point = np.cumsum([0, *(view.n_points for view in views)]).tolist()
    count = np.concatenate([part.count for part in parts])
    offsets = np.zeros(len(count) + 1, np.int64)
    count.cumsum(out=offsets[1:])
    reflectance = None
    if any(part.reflectance is not None for part in parts):
        reflectance = np.concatenate([_reflectance(part) for part in parts])
    feet = [part.feet + first for part, first in zip(parts, first_point, strict=False) if part.feet is not None]
    return Proposals(
        members=np.concatenate([part.members + first for part, first in zip(parts, first_point, strict=False)]),
        offsets=offsets,
        coordinates=np.concatenate([part.coordinates for part in parts], axis=1),
        centroid=np.concatenate([part.centroid for part in parts]),
        box=np.concatenate([part.box for part in parts]),
        cut=np.concatenate([part.cut for part in parts]),
        ground_z_m=np.concatenate([_ground_z_m(part) for part in parts]),
        reflectance=reflectance,
        kind=np.concatenate([*_kinds(parts), np.zeros(0, np.int8)]),
        feet=np.concatenate([*feet, np.zeros((2, 0), np.int64)], axis=1),
        beam_sr=np.concatenate([view.beam_sr for view in views]),
    )


def _kinds(parts: Sequence[Proposals]) -> Iterator[Int8]:
    for part in parts:
        assert part.kind is not None  # the segmenter writes them
        yield part.kind


def _reflectance(part: Proposals) -> Float64:
    """(P, 5) statistics, NaN where the sensor has none."""
    return np.full((len(part), N_REFLECTANCE), np.nan) if part.reflectance is None else part.reflectance


def _ground_z_m(part: Proposals) -> Float64:
    """(P,) z of the ground; a sweep without proposals has none."""
    return np.zeros(len(part)) if part.ground_z_m is None else part.ground_z_m


class _Cells(NamedTuple):
    """Occupied cells of the proposals of one sensor, ascending."""

    number: Int  # (c,)
    proposal: Int  # (c,) one of those in each


def _cells(proposals: Proposals, which: Int, cell_m: float) -> _Cells:
    """Cells of the proposals `which` (R,), which follow one another."""
    if not len(which):
        return _Cells(_NO_ROWS, _NO_ROWS)
    members = slice(proposals.offsets[which[0]], proposals.offsets[which[-1] + 1])
    x, y = np.floor(proposals.coordinates[:2, members] / np.float32(cell_m)).astype(np.int64)
    number, first = np.unique(x * _STRIDE + y, return_index=True)
    return _Cells(number, which.repeat(proposals.count[which])[first])


def _partners(proposals: Proposals, sensor: Int, tuning: JoiningTuning) -> Int:
    """(2, k) pairs of proposals that are joined.

    Two proposals of two sensors are joined where they share cells, are near one another in height, and at least one
    of them shares more cells with the other than with any third.
    """
    n = len(proposals)
    cells = [_cells(proposals, np.flatnonzero(sensor == k), tuning.cell_m) for k in range(sensor.max(initial=-1) + 1)]
    shared_of_sensors = [_shared(a, b, n) for a, b in combinations(cells, 2)]
    candidates = np.concatenate([*shared_of_sensors, np.zeros((3, 0), np.int64)], axis=1)
    a, b, _ = candidates
    bottom = proposals.box[:, 2] - proposals.box[:, 5] / 2
    top = bottom + proposals.box[:, 5]
    near = np.maximum(bottom[a], bottom[b]) - np.minimum(top[a], top[b]) < tuning.gap_m
    a, b, shared = candidates[:, near]
    most = np.zeros(n, np.int64)  # cells that each proposal shares with its best partner
    np.maximum.at(most, a, shared)
    np.maximum.at(most, b, shared)
    best = (shared == most[a]) | (shared == most[b])
    return np.stack([a[best], b[best]])


def _shared(a: _Cells, b: _Cells, n: int) -> Int:
    """(3, k) proposals of one and of another sensor, and the number of pairs of their cells that are one or touch."""
    hits = []
    for i, k in _NEIGHBOURS:
        wanted = a.number + (i * _STRIDE + k)
        at = np.minimum(np.searchsorted(b.number, wanted), max(len(b.number) - 1, 0))
        found = np.flatnonzero(b.number[at] == wanted) if len(b.number) else _NO_ROWS
        hits.append(a.proposal[found] * n + b.proposal[at[found]])
    pair, shared = np.unique(np.concatenate(hits), return_counts=True)
    return np.stack([pair // max(n, 1), pair % max(n, 1), shared])


def _groups(n: int, pairs: Int) -> Int:
    """(n,) group of each proposal; both of each pair (2, k) are in one. Groups have the order of their first ones.

    Each proposal starts as a group of its own. The lower number of a pair is passed on until nothing changes.
    """
    first = np.arange(n)  # first proposal of the group of each, as far as it is known
    before = np.zeros(0, np.int64)
    while not np.array_equal(first, before):
        before = first.copy()
        least = first[pairs].min(axis=0)
        for ends in pairs:
            np.minimum.at(first, ends, least)
    return np.asarray(np.unique(first, return_inverse=True)[1], np.int64).reshape(-1)


def _joined(proposals: Proposals, sensor: Int, group: Int, kernels: Kernels) -> Proposals:
    """The proposals (P,) of the groups (P,), whose boxes have the heading of the part with most points."""
    n = int(group.max()) + 1
    count = proposals.count
    order = np.lexsort((-count, group))  # in each group the one with most points first
    first = np.searchsorted(group[order], np.arange(n))
    largest = order[first]
    members, coordinates, total = kernels.sort_members(
        proposals.members, proposals.coordinates, proposals.offsets, group, (_NO_ROWS, _NO_ROWS), n
    )
    whole = proposals.regrouped(members, coordinates, total, largest)
    several = np.flatnonzero(np.bincount(group) > 1)
    runs = np.array((whole.offsets[several], whole.offsets[several + 1]))
    _, few = kernels.copy_runs(members, coordinates, runs)
    offsets = np.concatenate([[0], total[several].cumsum()])
    box = whole.box.copy()
    box[several] = kernels.upright_boxes(few, offsets, box[several, 6])
    centroid = whole.centroid.copy()
    centroid[several] = (kernels.group_sums(few, offsets) / total[several]).T
    covered_m2 = np.add.reduceat((count * _point_m2(proposals))[order], first)
    n_sensors = sensor.max() + 1
    sensors = np.bincount(np.unique(group * n_sensors + sensor) // n_sensors)  # that see each
    return replace(
        whole,
        box=box,
        centroid=centroid,
        cut=np.bitwise_and.reduceat(proposals.cut[order], first),  # where one of them sees the end, it is seen
        ground_z_m=np.add.reduceat((_ground_z_m(proposals) * count)[order], first) / total,
        beam_sr=covered_m2 / (sensors * total * square_range_m2(box)),
    )


def _point_m2(proposals: Proposals) -> Float64:
    """(P,) area that a point of each covers."""
    assert proposals.beam_sr is not None  # what stands side by side has it
    return proposals.beam_sr * square_range_m2(proposals.box)


def square_range_m2(box: Float64) -> Float64:
    """(P,) squares of the horizontal distances of boxes (P, 7), 1 at least [m2]."""
    x, y = box[:, :2].T
    return np.asarray(np.maximum(x * x + y * y, 1.0))
