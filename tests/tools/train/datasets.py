"""Data sets and scans for the tests of the training tools."""

from __future__ import annotations

from typing import Any

import numpy as np

from modt.classes import ObjectClass
from modt.classification.crops import Crops
from modt.geometry import FieldOfView
from modt.types import N_REFLECTANCE, Bool, Float32, Int
from tools.train.dataset import Dataset
from tools.train.labelled_scans import Scan


def data_of(crops: Crops, label: Int, **columns: Any) -> Dataset:
    """Crops of one real drive, whole and without reflectance, except for the columns given."""
    n = len(crops)
    false, zero, empty = np.zeros(n, np.bool_), np.zeros(n, np.int64), np.zeros(0, np.int64)
    table: dict[str, Any] = {"partial": false, "unknown": false, "tall": false, "variant": zero, "drive": zero}
    table |= {"reflectance": np.full((n, N_REFLECTANCE), np.nan), "truth_label": empty, "truth_drive": empty}
    return Dataset(crops, label, **(table | {"provenance": [], "sha256": []} | columns))


def scan_of(points: Float32, objects: list[Int], kinds: list[ObjectClass], unlabelled: Bool) -> Scan:
    """A scan over the full circle whose objects have no boxes."""
    boxes = np.full((len(objects), 7), np.nan)
    return Scan("scan", "drive", points, tuple(objects), tuple(kinds), boxes, FieldOfView(), unlabelled)
