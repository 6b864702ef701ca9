"""The data set of crops, as tools/train/build_crops.py writes it."""

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
"""Variants: real scans as the segmentation that ships cuts them up; cut up otherwise, pasted and synthetic ones are
there for training alone, and so is what nobody labelled."""

SENSOR_HEIGHT_M = 1.73
"""Of KITTI's, which the synthetic sensors stand at as well."""
APART = ("offsets", "provenance")


@dataclass(frozen=True)
class Dataset:
    """Labelled crops in the sensor frame.

    Attributes:
        crops: all of them, and label, partial, unknown, tall, variant, drive: (R,) of each.
        reflectance: (R, 5) of their returns where they were measured; NaN where unknown or of another sensor.
        truth_label, truth_drive: of each labelled object, seen by the segmentation or not.
        provenance: how each file was made.
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
    def clear(self) -> Bool:
        """(R,) what can be learnt from: objects, and what is known to be none."""
        return ~self.partial & ((self.label > 0) | ~self.unknown)

    def take(self, rows: Int) -> Crops:
        """Crops of these rows."""
        count = self.crops.count[rows]
        offsets = np.append(0, np.cumsum(count))
        return Crops(
            self.crops.xyz[np.repeat(self.crops.offsets[rows] - offsets[:-1], count) + np.arange(offsets[-1])],
            offsets,
        )


def load(*paths: Path) -> Dataset:
    """Read data sets and put them together."""
    parts = []
    for path in paths:
        with np.load(path) as file:
            parts.append({key: file[key] for key in file.files})
    joined = {key: np.concatenate([part[key] for part in parts]) for key in parts[0] if key not in APART}
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
    """Fold of each drive, objects of the rare classes spread evenly; NONE where nothing is judged: always learnt."""
    counted = len(data.truth_drive) > 0
    drive, label = (data.truth_drive, data.truth_label) if counted else (data.drive, data.label)
    weight = np.zeros((int(max(data.drive.max(), drive.max())) + 1, N_CLASSES))
    np.add.at(weight, (drive, label), 1.0)
    weight /= weight.sum(axis=0).clip(1)
    load_of, fold = np.zeros((k, N_CLASSES)), np.full(len(weight), NONE)
    judged = np.unique(data.drive[data.variant == data.variant.min()])
    for drive in judged[np.argsort(-weight[judged].max(axis=1), kind="stable")]:
        fold[drive] = np.argmin((load_of + weight[drive]).max(axis=1) + load_of.sum(axis=1) * 1e-3)
        load_of[fold[drive]] += weight[drive]
    return fold
