"""What stands, and where: the landmarks by which a sensor without odometry finds its way.

What has stood for a while lies where it was seen on average, not where it was seen last: then an error of one frame
is not handed on to all that follow.
"""

from __future__ import annotations

import numpy as np

from modt.tracking.kdop_association import carried
from modt.tracking.track_table import Followed
from modt.types import NONE, Bool, Float64, Int

STOOD = 3
"""Frames from which the mean of what stands is its place."""
GAIN = 0.03
"""Least say of a new view in a mean outline."""
SAME_M = 0.2
"""An end of an outline that is off by more is another end."""


def keep(tracks: Followed) -> None:
    """Take what the last frame showed into the mean outlines of what stands; once in each frame without a pose."""
    t, rows = tracks, (tracks.proposal != NONE).nonzero()[0]
    t.stood[rows] = stood = np.where(t.still[rows], t.stood[rows] + 1, 0)
    gain = np.maximum(1.0 / np.maximum(stood, 1), GAIN)[:, None]
    mean = t.landmark.take(rows, axis=0)
    off = t.outline.take(rows, axis=0) - mean
    t.landmark[rows] = mean + np.where(np.abs(off) < SAME_M, gain, 1.0) * off


def forget(tracks: Followed) -> None:
    """Where poses are given nobody keeps landmarks: should they fail, what stands then is noted from then on."""
    tracks.stood[:] = 0


def places(tracks: Followed) -> tuple[Int, Float64]:
    """Rows of what stands or may, and the (8, n) outlines that it should show [m, world]."""
    rows: Int = ((tracks.still | (tracks.hits < 3)) & (tracks.missed <= 2)).nonzero()[0]
    outline = carried(tracks).take(rows, axis=1)
    known = stands(tracks)[rows]
    outline[:, known] = tracks.landmark[rows[known]].T
    return rows, outline


def stands(tracks: Followed) -> Bool:
    """(M,) what has stood for a while."""
    stand: Bool = tracks.still & (tracks.stood >= STOOD)
    return stand
