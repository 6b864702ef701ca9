"""Extent of the scene that a picture shows."""

from __future__ import annotations

import numpy as np

from modt.types import Int
from modt.viewer.theme import REACH_M
from modt.viewer.track_rows import COLUMNS, SCALE

_SIDE_M = 32.0
"""Half the height of a picture whose half width is REACH_M."""
RINGS_M = {6.0: 2, 10.0: 5, 15.0: 5, 20.0: 10, 30.0: 10, REACH_M: 20}
"""Ranges that a picture may reach, and the distance of the rings in it."""
_NEARLY = 0.95
"""Share of the tracked boxes that must be visible."""


def reach_m(tracks: Int) -> float:
    """Half the width of a picture that shows nearly all of (R, COLUMNS) rows of tracks; REACH_M at most."""
    seen = tracks[tracks[:, COLUMNS.index("seen")] > 0]
    if not len(seen):
        return REACH_M
    x, y = (np.abs(seen[:, COLUMNS.index(name)]) / SCALE[name] for name in ("x", "y"))
    needed = np.quantile(np.maximum(x, y * REACH_M / _SIDE_M), _NEARLY)
    return next((reach for reach in RINGS_M if reach >= needed), REACH_M)
