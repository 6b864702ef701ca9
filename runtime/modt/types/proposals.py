"""Segments of a frame that could be objects, and the kinds of its points."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum, IntFlag

import numpy as np

from modt.types.arrays import NONE, Float32, Float64, Int, Int8, Self


class Cut(IntFlag):
    """Sides of a proposal that end where the view of the sensor ends. The object may reach beyond them."""

    TOP = 1  # at the highest beam
    BOTTOM = 2  # at the lowest beam
    SIDE = 4  # at the edge of the field of view or of a blind sector
    NEAR = 8  # at the nearest range used


class PointKind(IntEnum):
    """Kind of a point of a frame. Every point has exactly one kind."""

    MEMBER = 0  # belongs to a proposal
    GROUND = -1
    STRUCTURE = -2  # above the ground, part of a surface that is no object: wall, hedge, shelf, beam
    LOW = -3  # above the ground, of a group too low for an object
    SPARSE = -4  # above the ground, of a group with too few points for an object, or that most rays pass: leaves
    OVERHEAD = -5  # of the ceiling, or higher than what is looked for
    OUT_OF_RANGE = -6  # too near, too far, in a blind sector, or no return
    OUT_OF_VIEW = -7  # outside the field of view
    FOOT = -8  # low, part of a proposal or a structure beside it
    AIRBORNE = -9  # above the ground, where most rays pass, while the air is full of fog, dust or flakes


OBSTACLES = PointKind.STRUCTURE, PointKind.LOW, PointKind.SPARSE, PointKind.AIRBORNE
"""Kinds, besides members of proposals, of what is above the ground and below the ceiling."""
LEFT_OUT: tuple[PointKind, ...] = tuple(kind for kind in PointKind if kind not in (PointKind.MEMBER, PointKind.FOOT))
"""Kinds of the points that belong to no proposal."""


@dataclass(frozen=True)
class Proposals:
    """The segments of one frame that could be objects.

    Reflectance is the mean, standard deviation and maximum of a proposal's returns, and the share of bright and of
    dark ones; NaN where none of them has any, None where the sweep carries none.
    """

    members: Int  # (K,) indices of points in the frame, grouped by proposal
    offsets: Int  # (P + 1,) proposal i owns members[offsets[i]:offsets[i + 1]]
    coordinates: Float32  # (3, K) x, y and z of the members [m, sensor frame], gathered once
    centroid: Float64  # (P, 3) mean of each proposal's points [m, sensor frame]
    box: Float64  # (P, 7) minimum box: x, y, z of its centre, l, w, h [m], yaw [rad], sensor frame, l >= w
    cut: Int  # (P,) flags of Cut
    ground_z_m: Float64 | None = None  # (P,) z of what each stands on [m, sensor frame], None where not known
    reflectance: Float64 | None = None  # (P, 5)
    kind: Int8 | None = None  # (N,) PointKind of each point of the frame, None where not known
    feet: Int | None = None  # (2, F) points of kind FOOT, and of each a point of what it belongs to
    beam_sr: Float64 | None = None  # (P,) solid angle of a point of each [sr], None for one sensor

    def lock(self) -> Self:
        """These proposals, whose columns nobody can write to from here on.

        Members, offsets and coordinates are not marked, since C takes read-only arrays several times slower.
        """
        for entries in (self.centroid, self.box, self.cut, self.ground_z_m, self.reflectance, self.beam_sr):
            if entries is not None:
                entries.setflags(write=False)
        return self

    def __len__(self) -> int:
        return len(self.offsets) - 1

    @property
    def count(self) -> Int:
        """(P,) points of each proposal."""
        return self.offsets[1:] - self.offsets[:-1]

    def label(self, n_points: int) -> Int:
        """(n_points,) proposal of each point of the frame, NONE where it belongs to none."""
        out = np.full(n_points, NONE, np.int64)
        out[self.members] = np.repeat(np.arange(len(self)), self.count)
        return out

    def regrouped(self, members: Int, coordinates: Float32, count: Int, source: Int) -> Proposals:
        """Members in another grouping.

        Args:
            members: (K,) points of the new proposals, one after the other.
            coordinates: (3, K) coordinates of those points.
            count: (Q,) members of each new proposal.
            source: (Q,) proposal whose centroid, box and other columns each new one takes over.
        """
        offsets = np.zeros(len(count) + 1, np.int64)
        count.cumsum(out=offsets[1:])
        return Proposals(
            members=members,
            offsets=offsets,
            coordinates=coordinates,
            centroid=self.centroid.take(source, axis=0),
            box=self.box.take(source, axis=0),
            cut=self.cut[source],
            ground_z_m=None if self.ground_z_m is None else self.ground_z_m.take(source),
            reflectance=None if self.reflectance is None else self.reflectance.take(source, axis=0),
            kind=self.kind,
            feet=self.feet,
            beam_sr=None if self.beam_sr is None else self.beam_sr.take(source),
        )

    @classmethod
    def empty(cls, kind: Int8 | None = None) -> Proposals:
        """No proposals; with the (N,) PointKind of each point of the frame."""
        return cls(
            members=np.zeros(0, np.int64),
            offsets=np.zeros(1, np.int64),
            coordinates=np.zeros((3, 0), np.float32),
            centroid=np.zeros((0, 3)),
            box=np.zeros((0, 7)),
            cut=np.zeros(0, np.int64),
            kind=kind,
        )


def copy_runs(members: Int, coordinates: Float32, runs: Int) -> tuple[Int, Float32]:
    """Members and (3, ...) coordinates of runs of them, one after the other.

    Args:
        members: (K,) points of the proposals.
        coordinates: (3, K) coordinates of those points.
        runs: (2, R) first row of each run, and the row after its last.
    """
    slices = [slice(*run) for run in runs.T.tolist()]
    return (
        np.concatenate([members[:0], *(members[run] for run in slices)]),
        np.concatenate([coordinates[:, :0], *(coordinates[:, run] for run in slices)], axis=1),
    )


def sort_members(
    members: Int, coordinates: Float32, offsets: Int, label: Int, moved: tuple[Int, Int], n: int
) -> tuple[Int, Float32, Int]:
    """Sort members (K,) and (3, K) coordinates by label, below n, and count (n,) the members of each label.

    Members keep their order within a label. A group, by offsets (G + 1,), has one label (G,). `moved` are rows of the
    members (S,), ascending, that have a label (S,) of their own instead.
    """
    label = label.repeat(offsets[1:] - offsets[:-1])
    member_rows, own_label = moved
    label[member_rows] = own_label
    # In the smallest type that holds n: up to sixteen bits are sorted by radix, which is several times faster.
    order = label.astype(np.min_scalar_type(n)).argsort(kind="stable")
    return members.take(order), coordinates.take(order, axis=1), np.bincount(label, minlength=n)
