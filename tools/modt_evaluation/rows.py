"""Tables of the judged objects and proposals, from which every figure is computed."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum
from typing import Any

import numpy as np
from numpy.typing import NDArray

from modt.classes import CLASS_NAMES, N_CLASSES
from modt.types import Bool, Float64, Int
from modt_evaluation.truth import Role

Rows = NDArray[np.void]
"""Structured array: OBJECT has a row for each object and frame, PROPOSAL for each tracked proposal and frame, and
REPORTED for each reported object and frame."""


class Outcome(IntEnum):
    """Outcome of the segmentation of an object (docs/evaluation.md)."""

    DETECTED = 0
    MERGED = 1
    SPLIT = 2
    PARTIAL = 3
    MISSED = 4


OBJECT = np.dtype(
    [
        ("drive", int),
        ("frame", int),
        ("id", int),
        ("type", object),  # as labelled
        ("class", int),
        ("role", int),
        ("range_m", float),  # range of the centre of the box
        ("in_view", bool),  # whether most of its points are
        ("to_segment", bool),  # judged for segmentation
        ("to_classify", bool),  # judged for average precision
        ("to_follow", bool),  # judged for the length of its track
        ("outcome", int),
        ("reported", int),  # reported class of the proposal that detects it, NONE without one
        ("reported_by_match", int),  # reported class of the proposal that stands for it, NONE without one
        ("track", int),  # track of its best proposal, NONE without one
        ("stamp_s", float),
        ("position", float, 2),  # centre of the box [m, world of the run]
        ("points", int),  # points clear of the ground
        ("reported_by_best", int),  # reported class of its best proposal if most of that lies on it, else NONE
    ]
)
PROPOSAL = np.dtype(
    [
        ("drive", int),
        ("frame", int),
        ("track", int),
        ("range_m", float),  # range of the object that it stands for, else mean range of its points
        ("posterior", float, N_CLASSES),
        ("reported", int),  # reported class
        ("label", int),  # class of the object that it stands for, BACKGROUND for none
        ("box_class", int),  # class of the object in whose box most of its points lie, BACKGROUND for none
        ("to_classify", bool),  # judged for average precision
        ("to_report", bool),  # judged for the reported class
        ("to_associate", bool),  # judged for HOTA, CLEAR and Identity
    ]
)
REPORTED = np.dtype(
    [
        ("drive", int),
        ("frame", int),
        ("track", int),
        ("class", int),  # reported class
        ("score", float),  # its posterior
        ("to_report", bool),  # judged where it stands for nothing labelled
        ("velocity", float, 2),  # [m/s, world of the run]
        ("object", int),  # object of the class whose centre is nearest, NONE without identity
        ("centre_m", float),  # distance of their centres in the ground plane, NaN without such an object
        ("shape", float),  # 1 - intersection over union of both, aligned
        ("heading_rad", float),  # difference of their headings
        ("iou", float),  # intersection over union with the object of the class that it overlaps, 0 without one
        ("iou_judged", bool),  # whether that object is judged for average precision
    ]
)


def table(dtype: np.dtype[np.void], n: int, **columns: Any) -> Rows:
    """N rows with these columns, each an array or one value for all. Other columns are zero."""
    rows = np.zeros(n, dtype)
    for name, column in columns.items():
        rows[name] = column
    return rows


def kinds(objects: Rows) -> dict[str, Bool]:
    """Masks of the counted rows of each class, and of the rows of each labelled type."""
    groups: dict[str, Bool] = {
        name: (objects["class"] == c) & (objects["role"] == Role.COUNTED) for c, name in enumerate(CLASS_NAMES) if c
    }
    return groups | {name: objects["type"] == name for name in sorted(set(objects["type"].tolist()))}


def ratio(part: float, whole: float) -> float | None:
    """Part over whole, None if the whole is zero."""
    return part / whole if whole else None


@dataclass(frozen=True)
class Association:
    """Identities of (n,) objects and (k,) tracks of one class in a frame, and the (n, k) similarity of each pair."""

    truth: Int
    track: Int
    similarity: Float64
