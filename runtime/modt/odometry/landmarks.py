"""What stands, and where: the landmarks by which a sensor without odometry finds its way.

What has stood for a while lies where it was seen on average, not where it was seen last: then an error of one frame
is not handed on to all that follow.
"""

from __future__ import annotations

import numpy as np

from modt.tracking.kdop_association import predicted_kdops
from modt.tracking.track_table import TrackTable
from modt.types import NONE, Bool, Float64, Int

STOOD = 3
"""Frames from which the mean of what stands is its place."""
GAIN = 0.03
"""Least say of a new view in a mean outline."""
SAME_M = 0.2
"""An end of an outline that is off by more is another end."""


def keep(tracks: TrackTable) -> None:
    """Take what the last frame showed into the mean outlines of what stands; once in each frame without a pose."""
    t, rows = tracks, (tracks.proposal != NONE).nonzero()[0]
    t.stationary_frames[rows] = stationary_frames = np.where(t.stationary[rows], t.stationary_frames[rows] + 1, 0)
    gain = np.maximum(1.0 / np.maximum(stationary_frames, 1), GAIN)[:, None]
    mean = t.landmark_kdop.take(rows, axis=0)
    off = t.kdop.take(rows, axis=0) - mean
    t.landmark_kdop[rows] = mean + np.where(np.abs(off) < SAME_M, gain, 1.0) * off


def forget(tracks: TrackTable) -> None:
    """Where poses are given nobody keeps landmarks: should they fail, what stands then is noted from then on."""
    tracks.stationary_frames[:] = 0


def places(tracks: TrackTable) -> tuple[Int, Float64]:
    """Rows of what stands or may, and the (8, n) outlines that it should show [m, world]."""
    rows: Int = ((tracks.stationary | (tracks.hits < 3)) & (tracks.missed <= 2)).nonzero()[0]
    kdop = predicted_kdops(tracks).take(rows, axis=1)
    known = stands(tracks)[rows]
    kdop[:, known] = tracks.landmark_kdop[rows[known]].T
    return rows, kdop


def stands(tracks: TrackTable) -> Bool:
    """(M,) what has stood for a while."""
    stand: Bool = tracks.stationary & (tracks.stationary_frames >= STOOD)
    return stand
