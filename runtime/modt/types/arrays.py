"""Types of arrays, and the values that stand for what is missing."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from typing_extensions import Self as Self  # noqa: PLC0414  # typing has it from Python 3.11 on
else:
    Self = Any

Float32 = NDArray[np.float32]
Float64 = NDArray[np.float64]
Int = NDArray[np.int64]
Int8 = NDArray[np.int8]
Bool = NDArray[np.bool_]

NONE = -1
"""Index that stands for no proposal or no track."""
UNRECORDED = -1.0
"""Reflectance of a return whose reflectance was not recorded. Any value below 0 means the same."""
N_REFLECTANCE = 5
"""Number of statistics of a proposal's reflectance."""
