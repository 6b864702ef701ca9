"""What became of the objects and the proposals of a frame; every figure is computed from these tables."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from enum import IntEnum
from typing import Self

import numpy as np
from numpy.typing import NDArray

from modt.types import Bool, Float64, Int


class Outcome(IntEnum):
    """What segmentation made of an object."""

    FOUND = 0
    MERGED = 1
    """Its proposal holds half of it, and is less than half its own."""
    SPLIT = 2
    """No proposal holds half of it, all together do."""
    PARTIAL = 3
    """Each holds half of the other, their intersection over union is one half or less."""
    MISSED = 4
    """Most of its points are in no proposal."""


class Rows:
    """A table of columns of one length."""

    @classmethod
    def joined(cls, tables: Sequence[Self]) -> Self:
        """The rows of all."""
        names = [f.name for f in fields(cls)]  # type: ignore[arg-type]
        return cls(*(np.concatenate([getattr(table, name) for table in tables]) for name in names))

    def take(self, which: Bool) -> Self:
        """Some of the rows."""
        return type(self)(*(getattr(self, f.name)[which] for f in fields(self)))  # type: ignore[arg-type]


@dataclass(frozen=True)
class ObjectRows(Rows):
    """Labelled objects, one row an object and frame.

    Attributes:
        drive, frame, id: which one it is.
        type_: labelled type.
        object_class, role: class and `Role`.
        range_m: of the box's centre [m].
        cut: by the view.
        to_segment, to_classify, to_follow: whether it is judged for segmentation, class and life.
        outcome: of segmentation.
        said: class of the proposal that found it, NONE where none did.
        track: that owns its best proposal, NONE where none does.
    """

    drive: Int
    frame: Int
    id: Int
    type_: NDArray[np.object_]
    object_class: Int
    role: Int
    range_m: Float64
    cut: Bool
    to_segment: Bool
    to_classify: Bool
    to_follow: Bool
    outcome: Int
    said: Int
    track: Int


@dataclass(frozen=True)
class ProposalRows(Rows):
    """Proposals that a track owns, one row a proposal and frame.

    Attributes:
        drive, frame, track: whose it is.
        range_m: of the object that it stands for, of none the mean of its points' [m].
        posterior: (R, 4) what is said of it.
        said: class that the program says.
        label: class of the object that it stands for, BACKGROUND for none.
        owner: class of the object whose box holds most of its points, BACKGROUND for none.
        to_classify, to_call: whether it is judged for average precision and for the class that is said.
    """

    drive: Int
    frame: Int
    track: Int
    range_m: Float64
    posterior: Float64
    said: Int
    label: Int
    owner: Int
    to_classify: Bool
    to_call: Bool


@dataclass(frozen=True, slots=True)
class Association:
    """Objects and tracks of one class in a frame.

    Attributes:
        truth: (n,) identities of objects.
        track: (k,) identities of tracks.
        similarity: (n, k) of each pair, 0 to 1.
    """

    truth: Int
    track: Int
    similarity: Float64


@dataclass(frozen=True, slots=True)
class Judged:
    """What became of a frame: rows of both tables, and by class what was to be associated."""

    objects: ObjectRows
    proposals: ProposalRows
    associations: tuple[Association, ...]
