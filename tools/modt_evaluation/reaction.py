"""Reaction: time until an object that has come near is reported as what it is."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from modt.classes import CLASS_NAMES
from modt_evaluation.rows import Rows
from modt_evaluation.truth import Role

MIN_POINTS = 20
"""Points of an object from which it could be reported."""
MAX_RANGE_M = 30.0
"""Range up to which it could be reported."""
LAST_FRAMES = 15
"""Objects that come this close to the end of a drive are left out."""


@dataclass(frozen=True)
class Reaction:
    """Frames from the first in which an object has MIN_POINTS within MAX_RANGE_M until it is reported as its class.

    Objects that are there in the first frame of a drive are counted apart.
    """

    entered: int  # objects that came later
    median_frames: float | None  # of those that are reported
    p90_frames: float | None
    never: int  # objects that are never reported
    at_start: int
    at_start_median_frames: float | None
    at_start_p90_frames: float | None
    at_start_never: int


def reactions(objects: Rows) -> dict[str, Reaction]:
    """The reaction to the objects of each class."""
    rows = objects[(objects["role"] == Role.COUNTED) & (objects["id"] >= 0)]
    first_frame, last_frame = (
        {d: f(objects["frame"][objects["drive"] == d]) for d in set(objects["drive"].tolist())} for f in (min, max)
    )
    found = {}
    for c, name in enumerate(CLASS_NAMES[1:], 1):
        waits: tuple[list[float], list[float]] = ([], [])
        of_class = rows[rows["class"] == c]
        for key in sorted(set(of_class[["drive", "id"]].tolist())):
            drive, id_ = key
            own = of_class[(of_class["drive"] == drive) & (of_class["id"] == id_)]
            own = own[(own["points"] >= MIN_POINTS) & (own["range_m"] < MAX_RANGE_M)]
            if not len(own) or own["frame"].min() > last_frame[drive] - LAST_FRAMES:
                continue
            begin = int(own["frame"].min())
            reported = own["frame"][own["reported_by_best"] == c]
            at_start = begin == first_frame[drive]
            waits[int(at_start)].append(float(reported.min() - begin) if len(reported) else np.inf)
        found[name] = Reaction(*_summary(waits[0]), *_summary(waits[1]))
    return found


def _summary(waits: list[float]) -> tuple[int, float | None, float | None, int]:
    """Objects, median and 90th percentile of the waits of those reported, and how many never are."""
    done = [wait for wait in waits if np.isfinite(wait)]
    middle, most = np.percentile(done, [50, 90]).tolist() if done else (None, None)
    return len(waits), middle, most, len(waits) - len(done)
