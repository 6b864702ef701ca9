"""Judgement of whole tracks after the last frame: their confidence, rival classes on one object, short gaps."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, fields

import numpy as np
from scipy.spatial import cKDTree

from modt.geometry import wrap
from modt.types import Bool, Float64, Int
from modt_desk.box_tracking.overlap import iou_3d

MIN_IOU = 0.25
"""Overlap of boxes of two classes from which both are of one object."""
REACH_M = 3.0
"""Distance of centres up to which that is tested."""


@dataclass(frozen=True, slots=True)
class TrackedBoxes:
    """The n boxes of tracks, in the world frame."""

    frame: Int  # (n,) index of the frame
    id: Int  # (n,) of the track
    image_box: Float64  # (n, 4) left, top, right, bottom [pixel]
    box: Float64  # (n, 7)
    confidence: Float64  # (n,) in the track, at that frame

    def take(self, rows: Bool | Int) -> TrackedBoxes:
        """The boxes at some rows."""
        return TrackedBoxes(
            self.frame[rows], self.id[rows], self.image_box[rows], self.box[rows], self.confidence[rows]
        )

    @classmethod
    def none(cls) -> TrackedBoxes:
        """No boxes."""
        return cls(np.zeros(0, np.int64), np.zeros(0, np.int64), np.zeros((0, 4)), np.zeros((0, 7)), np.zeros(0))

    @classmethod
    def join(cls, parts: Iterable[TrackedBoxes]) -> TrackedBoxes:
        """The boxes of all parts."""
        whole = list(parts)
        return cls(*(np.concatenate([getattr(part, f.name) for part in whole]) for f in fields(cls)))


def confident(found: TrackedBoxes, least: float) -> TrackedBoxes:
    """Keep the tracks whose mean confidence reaches `least`."""
    return found.take(_mean(found.id, found.confidence) >= least)


def of_one_class(found: TrackedBoxes, object_class: Int) -> TrackedBoxes:
    """Remove tracks most of whose boxes lie on a more confident track of another class; classes are (n,)."""
    mean = _mean(found.id, found.confidence)
    place = np.column_stack([found.box[:, :2], 2 * REACH_M * found.frame])
    a, b = cKDTree(place).query_pairs(REACH_M, output_type="ndarray").T
    rivals = (object_class[a] != object_class[b]) & (iou_3d(found.box[a], found.box[b]) > MIN_IOU)
    a, b = a[rivals], b[rivals]
    beaten = np.zeros(len(mean))
    beaten[np.where(mean[a] < mean[b], a, b)] = 1.0
    return found.take(_mean(found.id, beaten) <= 0.5)


def _mean(ids: Int, values: Float64) -> Float64:
    """(n,) mean of the values (n,) of each one's track."""
    _, track = np.unique(ids, return_inverse=True)
    mean: Float64 = (np.bincount(track, values) / np.bincount(track))[track]
    return mean


def bridged(found: TrackedBoxes, max_gap: int) -> TrackedBoxes:
    """The boxes, ordered by frame, with those interpolated where a track is missing for max_gap frames at most."""
    found = found.take(np.lexsort((found.frame, found.id)))
    gap = np.diff(found.frame) - 1
    before = np.flatnonzero((np.diff(found.id) == 0) & (gap > 0) & (gap <= max_gap))
    missing = gap[before]
    step = 1 + np.arange(missing.sum()) - np.repeat(np.cumsum(missing) - missing, missing)
    row = np.repeat(before, missing)
    share = (step / (1 + gap[row]))[:, None]
    change = found.box[row + 1] - found.box[row]
    change[:, 6] = wrap(change[:, 6])
    filled = TrackedBoxes(
        frame=found.frame[row] + step,
        id=found.id[row],
        image_box=found.image_box[row] + share * (found.image_box[row + 1] - found.image_box[row]),
        box=found.box[row] + share * change,
        confidence=found.confidence[row] + share[:, 0] * (found.confidence[row + 1] - found.confidence[row]),
    )
    both = TrackedBoxes.join([found, filled])
    return both.take(np.lexsort((both.id, both.frame)))
