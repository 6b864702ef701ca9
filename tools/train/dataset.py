"""Data sets of crops, as written by build_crops and build_synthetic_crops."""

from __future__ import annotations

import hashlib
import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from modt.classes import N_CLASSES
from modt.classification.crops import Crops
from modt.types import NONE, Bool, Float64, Int

SHIPPED, CLUSTERED, PASTED, SYNTHETIC, UNLABELLED = range(5)
"""Variants of crops: real scans under the default segmentation; real scans under other cell sizes; real scans with
pasted objects; synthetic sweeps; unlabelled parts of real scans. All but the first are for training alone."""

SENSOR_HEIGHT_M = 1.73
"""Height of the sensor above the ground in KITTI and in the simulation."""
NOT_CONCATENATED = ("offsets", "provenance")


@dataclass(frozen=True)
class Dataset:
    """Labelled crops in the sensor frame.

    Attributes:
        crops: R crops.
        label, partial, unknown, tall: (R,) as in tools.train.build_crops.Labels.
        variant, drive: (R,) of each crop.
        reflectance: (R, 5) statistics of the returns; NaN where unknown or measured by another sensor.
        truth_label, truth_drive: (T,) of each labelled object, those missed by the segmentation included.
        provenance: options and counts of each file.
        sha256: of each file.
    """

    crops: Crops
    label: Int
    partial: Bool
    unknown: Bool
    tall: Bool
    variant: Int
    drive: Int
    reflectance: Float64
    truth_label: Int
    truth_drive: Int
    provenance: list[dict[str, Any]]
    sha256: list[str]

    def __len__(self) -> int:
        return len(self.label)

    @property
    def trainable(self) -> Bool:
        """(R,) whole objects, and known background."""
        return ~self.partial & ((self.label > 0) | ~self.unknown)

    def take(self, rows: Int) -> Crops:
        """Crops of rows (R,)."""
        count = self.crops.count[rows]
        offsets = np.append(0, np.cumsum(count))
        return Crops(
            self.crops.xyz[np.repeat(self.crops.offsets[rows] - offsets[:-1], count) + np.arange(offsets[-1])],
            offsets,
        )


def load(*paths: Path) -> Dataset:
    """Read and concatenate data sets."""
    parts = []
    for path in paths:
        with np.load(path) as file:
            parts.append({key: file[key] for key in file.files})
    joined = {key: np.concatenate([part[key] for part in parts]) for key in parts[0] if key not in NOT_CONCATENATED}
    count = np.concatenate([np.diff(part["offsets"]) for part in parts])
    _, drive = np.unique(np.concatenate([joined["drive"], joined["truth_drive"]]), return_inverse=True)
    n = len(joined["label"])
    return Dataset(
        crops=Crops(joined["xyz"], np.append(0, np.cumsum(count))),
        label=joined["label"].astype(np.int64),
        partial=joined["partial"],
        unknown=joined["unknown"],
        tall=joined["tall"],
        variant=joined["variant"].astype(np.int64),
        drive=drive[:n],
        reflectance=joined["reflectance"],
        truth_label=joined["truth_label"].astype(np.int64),
        truth_drive=drive[n:],
        provenance=[json.loads(str(part["provenance"])) for part in parts],
        sha256=[hashlib.sha256(path.read_bytes()).hexdigest() for path in paths],
    )


def folds(data: Dataset, k: int) -> Int:
    """(D,) fold of each drive, rare classes balanced over folds; NONE for drives used in every training set."""
    has_truth = len(data.truth_drive) > 0
    drive, label = (data.truth_drive, data.truth_label) if has_truth else (data.drive, data.label)
    weight = np.zeros((int(max(data.drive.max(), drive.max())) + 1, N_CLASSES))
    np.add.at(weight, (drive, label), 1.0)
    weight /= weight.sum(axis=0).clip(1)
    load, fold = np.zeros((k, N_CLASSES)), np.full(len(weight), NONE)
    validation = np.unique(data.drive[data.variant == data.variant.min()])
    for drive in validation[np.argsort(-weight[validation].max(axis=1), kind="stable")]:
        fold[drive] = np.argmin((load + weight[drive]).max(axis=1) + load.sum(axis=1) * 1e-3)
        load[fold[drive]] += weight[drive]
    return fold
