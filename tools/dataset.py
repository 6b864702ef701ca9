"""The data set of crops, as tools/build_crops.py writes it."""

from __future__ import annotations

import hashlib
import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from modt.classification.crops import Crops
from modt.types import Bool, Int

SHIPPED, CLUSTERED, PASTED, SYNTHETIC = range(4)
"""Variants: real scans as the segmentation that ships cuts them up; cut up otherwise, pasted and synthetic ones are
there for training alone."""


@dataclass(frozen=True)
class Dataset:
    """Labelled crops in the sensor frame.

    Attributes:
        crops: all of them, and label, partial, variant, drive: (R,) of each.
        truth_label, truth_drive: of each labelled object, seen by the segmentation or not.
        provenance: how it was made.
        sha256: of the file.
    """

    crops: Crops
    label: Int
    partial: Bool
    variant: Int
    drive: Int
    truth_label: Int
    truth_drive: Int
    provenance: dict[str, Any]
    sha256: str

    def __len__(self) -> int:
        return len(self.label)

    def take(self, rows: Int) -> Crops:
        """Crops of these rows."""
        count = self.crops.count[rows]
        offsets = np.append(0, np.cumsum(count))
        return Crops(
            self.crops.xyz[np.repeat(self.crops.offsets[rows] - offsets[:-1], count) + np.arange(offsets[-1])],
            offsets,
        )


def load(path: Path) -> Dataset:
    """Read a data set."""
    with np.load(path) as file:
        _, drive = np.unique(np.concatenate([file["drive"], file["truth_drive"]]), return_inverse=True)
        n = len(file["label"])
        return Dataset(
            crops=Crops(file["xyz"], file["offsets"]),
            label=file["label"].astype(np.int64),
            partial=file["partial"],
            variant=file["variant"].astype(np.int64),
            drive=drive[:n],
            truth_label=file["truth_label"].astype(np.int64),
            truth_drive=drive[n:],
            provenance=json.loads(str(file["provenance"])),
            sha256=hashlib.sha256(path.read_bytes()).hexdigest(),
        )
