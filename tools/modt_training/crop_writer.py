"""Crops of labelled scans: proposals of the segmentation, labelled by overlap with objects."""

from __future__ import annotations

import dataclasses
import hashlib
import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

import modt
from modt.class_sizes import IS_VEHICLE
from modt.classes import N_CLASSES, ObjectClass
from modt.classification.crops import gather, ground_z_m
from modt.segmentation.segmenter import Segmenter
from modt.types import N_REFLECTANCE, NONE, Bool, Float64, Int, Proposals
from modt_training.dataset import CLUSTERED, MAJORITY, PASTED, REAL, VARIANT_NAMES, Sensors, is_trainable
from modt_training.scan import Scan

MAX_POINTS = 1200


UNLABELLED_SHARE = 0.2
"""A greater share of points without a label makes a proposal unknown."""


FOREIGN_SHARE = 0.2
"""A greater share of another object's points makes a proposal partial."""


MIN_BOX_POINTS = 5
"""Minimum points of an object for training."""


MIN_DETECTABLE_POINTS = 10
"""Minimum points of an object for the ground truth of the validation."""


TALL_M = 1.85
"""Minimum height of a van."""


CELL_SCALES = (0.75, 1.4)
"""Cell sizes relative to the profile's, for training alone."""


@dataclass(frozen=True)
class Labels:
    """Labels of the proposals of a scan.

    Attributes:
        kind: (R,) class.
        partial: (R,) fragment or merged objects.
        unknown: (R,) excluded from validation: outside the annotated regions, or an object with too few points.
        tall: (R,) vehicles of at least TALL_M; rare, and different in shape from other cars.
        majority: (R,) class whose objects hold more than half of its points, whole or not.
        whole: (B,) the proposal of each object, NONE where it has none of its own.
    """

    kind: Int
    partial: Bool
    unknown: Bool
    tall: Bool
    majority: Int
    whole: Int


def label(scan: Scan, proposals: Proposals) -> Labels:
    """Label the proposals of a scan by overlap with its objects.

    The order of the objects matters: points of another object make a whole proposal partial only if that object
    comes after the one that the proposal is.
    """
    number = proposals.label(len(scan.points))
    size = proposals.count
    kind = np.full(len(proposals), ObjectClass.BACKGROUND, np.int64)
    outside = np.bincount(number[scan.unlabelled & (number >= 0)], minlength=len(proposals))
    partial = np.zeros(len(proposals), np.bool_)
    tall = np.zeros(len(proposals), np.bool_)
    unknown = outside > UNLABELLED_SHARE * size
    held = np.zeros((len(proposals), N_CLASSES))
    whole_of = np.full(len(scan.objects), NONE)
    valid = points_in_view(scan) >= MIN_DETECTABLE_POINTS
    for k, (members, object_class, box) in enumerate(zip(scan.objects, scan.kinds, scan.boxes, strict=True)):
        if len(members) < MIN_BOX_POINTS:
            continue
        # Points that each proposal shares with the object; a proposal is whole where both hold most of the other.
        proposal_of_member = number[members]
        shared = np.bincount(proposal_of_member[proposal_of_member >= 0], minlength=len(proposals))
        held[:, object_class] += shared
        whole = (shared > 0.5 * size) & (shared > 0.5 * len(members))
        kind[whole] = object_class
        tall[whole] = IS_VEHICLE[object_class] and box[5] > TALL_M
        partial |= (shared > FOREIGN_SHARE * size) & ~whole
        partial[whole] = False
        unknown[whole] = not valid[k]
        whole_of[k] = np.flatnonzero(whole)[0] if whole.any() else NONE
    majority = np.where(held.max(axis=1) > 0.5 * size, held.argmax(axis=1), ObjectClass.BACKGROUND)
    return Labels(kind, partial, unknown, tall, majority, whole_of)


def reflectance_of(proposals: Proposals) -> Float64:
    """(P, 5) reflectance statistics of proposals, NaN where not measured."""
    if proposals.reflectance is None:
        return np.full((len(proposals), N_REFLECTANCE), np.nan)
    return proposals.reflectance


def points_in_view(scan: Scan) -> Int:
    """(B,) points of each object in the annotated field of view."""
    return np.array([(scan.fov.depth(scan.points[members]) > 0).sum() for members in scan.objects], np.int64)


class CropWriter:
    """Collects crops and writes the data set."""

    def __init__(self) -> None:
        self.columns: dict[str, list[Any]] = {}
        self.rows = 0

    def add(self, scan: Scan, variant: int, scale: float = 1.0, *, validation: bool = False) -> None:
        """Add the proposals of a scan at `scale` times the profile's cell size; for validation with its objects."""
        stage = scan.profile.segmentation
        sensor = scan.profile.sensor
        stage = dataclasses.replace(stage, cell_m=stage.cell_m * scale)
        proposals = Segmenter(stage, sensor, scan.fov).segment(scan.points)
        labels = label(scan, proposals)
        whole = (labels.kind > 0) & ~labels.partial
        kept = np.flatnonzero(whole) if variant == PASTED else np.arange(len(proposals))
        crops = gather(proposals, kept, MAX_POINTS)
        n = len(kept)
        row: dict[str, Any] = {"xyz": np.ascontiguousarray(crops.xyz), "count": crops.count}
        row |= {"label": labels.kind[kept].astype(np.int8)}
        row |= {"partial": labels.partial[kept], "unknown": labels.unknown[kept], "tall": labels.tall[kept]}
        row |= {"variant": np.full(n, variant, np.int8), "reflectance": reflectance_of(proposals)[kept]}
        row |= {MAJORITY: labels.majority[kept].astype(np.int8)}
        row |= {key: np.full(n, getattr(scan, key)) for key in ("name", "drive", "sensor")}
        row |= dataclasses.asdict(Sensors.of(sensor, proposals.box[kept], ground_z_m(proposals, kept, sensor)))
        if validation:
            kinds = np.array(scan.kinds, np.int64)
            points = points_in_view(scan)
            objects = np.flatnonzero((kinds > ObjectClass.BACKGROUND) & (points >= MIN_DETECTABLE_POINTS))
            proposal = labels.whole[objects]
            truth = {
                "label": kinds[objects],
                "points": points[objects],
                "row": np.where(proposal == NONE, NONE, proposal + self.rows),
            }
            truth |= {key: np.full(len(objects), getattr(scan, key)) for key in ("drive", "sensor")}
            row |= {f"truth_{key}": value for key, value in truth.items()}
        for key, value in row.items():
            self.columns.setdefault(key, []).append(value)
        self.rows += n

    def save(self, path: Path, provenance: dict[str, object]) -> str:
        """Write the file; returns a line with its hash and the number of trainable crops by variant and class."""
        table: dict[str, Any] = {key: np.concatenate(parts) for key, parts in self.columns.items()}
        table["offsets"] = np.append(0, np.cumsum(table.pop("count")))
        for key in ("label", "points", "row", "drive", "sensor"):
            table.setdefault(f"truth_{key}", np.zeros(0, np.str_ if key in {"drive", "sensor"} else np.int64))
        trainable = is_trainable(table["partial"], table["label"], table["unknown"])
        tally = {
            name: np.bincount(table["label"][trainable & (table["variant"] == v)], minlength=N_CLASSES).tolist()
            for v, name in enumerate(VARIANT_NAMES)
        }
        facts = {"scans": len(np.unique(table["name"])), "crops": tally, "modt": modt.__version__}
        facts |= {"sensors": np.unique(table["sensor"]).tolist()}
        np.savez_compressed(path, provenance=np.array(json.dumps(provenance | facts)), **table)
        return f"{path} {hashlib.sha256(path.read_bytes()).hexdigest()} {json.dumps(tally)}"


def add_labelled(writer: CropWriter, scan: Scan) -> None:
    """Add a scan, for validation and, in finer and coarser clusters, for training."""
    writer.add(scan, REAL, validation=True)
    for scale in CELL_SCALES:
        writer.add(scan, CLUSTERED, scale)
