"""Points from named columns, as point-cloud files have them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from modt.errors import ScanError
from modt.ros2.point_cloud2 import reflectance_name
from modt.types import UNRECORDED, Float32

MAX_POINTS = 10_000_000
"""In a sweep; a header that promises more is wrong."""
BYTE_MAX, WORD_MAX = 255, 65_535
SKIPPED = "the frame is skipped; convert it to x, y, z [m] and reflectance"


def numbers_of(words: Sequence[bytes], n_points: int, width: int, origin: object) -> NDArray[np.float64]:
    """(n_points, width) numbers of text.

    Raises:
        ScanError: there are fewer, or what is no number.
    """
    if len(words) < n_points * width:
        raise ScanError(origin, f"truncated: {len(words)} numbers for {n_points} points", SKIPPED)
    try:
        return np.array(words[: n_points * width], np.float64).reshape(-1, width)
    except ValueError:
        raise ScanError(origin, "its text holds what is no number", SKIPPED) from None


def points_of(columns: Mapping[str, NDArray[Any]], origin: object) -> Float32:
    """(N, 4) points; reflectance is UNRECORDED where there is no column, NaN where its scale is unknown.

    Whole numbers are divided by 255, or by 65535 where they exceed 255; others are left for `sanitised`.

    Raises:
        ScanError: x, y or z is missing.
    """
    lacking = [axis for axis in "xyz" if axis not in columns]
    if lacking:
        raise ScanError(origin, f"no column {', '.join(lacking)}", SKIPPED)
    points = np.empty((len(columns["x"]), 4), np.float32)
    with np.errstate(over="ignore"):  # double coordinates beyond float32: infinite, which counts as no return
        for i, axis in enumerate("xyz"):
            points[:, i] = columns[axis]
    name = reflectance_name(columns)
    points[:, 3] = UNRECORDED if name is None else _reflectance(columns[name])
    return points


def _reflectance(values: NDArray[Any]) -> NDArray[Any]:
    greatest = values.max(initial=0)
    if np.issubdtype(values.dtype, np.integer):
        return np.clip(values / (BYTE_MAX if greatest <= BYTE_MAX else WORD_MAX), 0.0, 1.0)
    return np.full(len(values), np.nan) if greatest > BYTE_MAX else values
