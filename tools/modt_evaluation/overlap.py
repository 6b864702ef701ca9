"""Points that boxes and proposals share."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from modt.geometry import inverse, transform
from modt.types import NONE, Bool, Float32, Float64, Int, Self
from modt_evaluation.frame import JudgedFrame
from modt_evaluation.truth import FrameTruth

PAD_M = 0.15
"""Distance beyond its box up to which points belong to an object [m]."""
FOOT_M = 0.25
"""Least distance of these points above its foot [m]."""


@dataclass(frozen=True)
class ObjectPoints:
    """Indices of the points of each of n labelled objects: clear of the ground, and all in its box."""

    clear: list[Int]
    whole: list[Int]

    @classmethod
    def of(cls, points: Float32, truth: FrameTruth) -> Self:
        """Select them among (N, 4) points of the sensor frame."""
        centre = transform(inverse(truth.T_box_sensor), truth.box[:, :3])
        reach = np.hypot(truth.box[:, 3], truth.box[:, 4]) / 2 + 2 * PAD_M
        lean = float(np.hypot(*truth.T_box_sensor[2, :2]))  # sine of the angle between the sensor and the boxes
        reach += lean * truth.box[:, 5] / 2
        across = np.ascontiguousarray(points[:, :2].T)
        found = cls([], [])
        for box, (x, y), r in zip(truth.box, centre[:, :2].tolist(), reach.tolist(), strict=True):
            k = np.flatnonzero((np.abs(across[0] - x) < r) & (np.abs(across[1] - y) < r))
            moved = in_box_frame(points[k], truth)
            within = inside(moved, box, foot_m=-PAD_M)
            clear = within & (moved[:, 2] > float(box[2] - box[5] / 2) + FOOT_M)
            found.clear.append(k[clear])
            found.whole.append(k[within])
        return found


@dataclass(frozen=True)
class Overlap:
    """Points that n objects and P proposals of a frame share. The last proposal is empty and stands for none."""

    clear: list[Int]  # points of each object, clear of the ground
    count: Int  # (n,) points of each object
    size: Int  # (P,) points of each proposal
    shared: Int  # (n, P) points of an object in a proposal
    held: Int  # (n, P) points of a proposal in an object's box, those near the ground too
    best: Int  # (n,) proposal that shares most with each object
    most: Int  # (n,) points that it shares
    iou: Float64  # (n,) intersection over union of the points of both
    most_of_object: Bool  # (n,) whether they share more than half of the object
    most_of_proposal: Bool  # (n,) whether they share more than half of the proposal

    @classmethod
    def of(cls, frame: JudgedFrame, objects: ObjectPoints | None = None) -> Overlap:
        """The overlap in a frame, whose points of labelled objects may be given."""
        p = max(frame.n_proposals, int(frame.proposal.max(initial=NONE)) + 1) + 1
        size = np.bincount(frame.proposal + 1, minlength=p + 1)[1:]
        objects = objects or ObjectPoints.of(frame.points, frame.truth)
        count = np.array([len(points) for points in objects.clear], np.int64)
        shared = _shared(objects.clear, frame.proposal, p)
        best = shared.argmax(axis=1)
        most = shared.max(axis=1)
        return cls(
            clear=objects.clear,
            count=count,
            size=size,
            shared=shared,
            held=_shared(objects.whole, frame.proposal, p),
            best=best,
            most=most,
            iou=most / np.maximum(size[best] + count - most, 1),
            most_of_object=most > 0.5 * count,
            most_of_proposal=most > 0.5 * size[best],
        )


def inside(points: NDArray[Any], box: Float64, pad_m: float = PAD_M, foot_m: float = FOOT_M) -> Bool:
    """(N,) whether (N, 3 or more) points lie in a (7,) box grown by pad_m, and foot_m or more above its foot."""
    x, y, z = (points[:, k] - float(box[k]) for k in range(3))
    c = float(np.cos(box[6]))
    s = float(np.sin(box[6]))
    length, width, height = (box[3:6] / 2).tolist()
    within: Bool = (np.abs(c * x + s * y) < length + pad_m) & (np.abs(c * y - s * x) < width + pad_m)
    within &= (z > foot_m - height) & (z < height + pad_m)
    return within


def in_box_frame(points: Float32, truth: FrameTruth) -> NDArray[Any]:
    """(N, 3 or more) points in the frame in which boxes are upright."""
    T = truth.T_box_sensor
    return points if np.array_equal(T, np.eye(4)) else transform(T, points[:, :3].astype(np.float64))


def _shared(objects: list[Int], proposal: Int, p: int) -> Int:
    """(n, p) points of each object in each proposal."""
    rows = np.repeat(np.arange(len(objects)), [len(points) for points in objects])
    of = proposal[np.concatenate([np.zeros(0, np.int64), *objects])]
    flat = np.bincount((rows * p + of)[of >= 0], minlength=len(objects) * p)
    return flat.reshape(len(objects), p).astype(np.int64)
