"""Data sets of crops made up for tests."""

from __future__ import annotations

from typing import Any

import numpy as np

from modt.classification.crops import Crops
from modt.types import N_REFLECTANCE, Int
from tools.train.dataset import Dataset


def data_of(crops: Crops, label: Int, **columns: Any) -> Dataset:
    """Crops of one shipped drive, clear and of unknown reflectance, but for the columns given."""
    n = len(crops)
    false, zero, nobody = np.zeros(n, np.bool_), np.zeros(n, np.int64), np.zeros(0, np.int64)
    table: dict[str, Any] = {"partial": false, "unknown": false, "tall": false, "variant": zero, "drive": zero}
    table |= {"reflectance": np.full((n, N_REFLECTANCE), np.nan), "truth_label": nobody, "truth_drive": nobody}
    return Dataset(crops, label, **(table | {"provenance": [], "sha256": []} | columns))
