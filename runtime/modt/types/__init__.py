"""Data that the stages exchange, one file a noun.

Everything is a structure of arrays, so that the work of a frame is vectorised over points, proposals and tracks. P is
the number of proposals in a frame, M the number of tracks alive, N the number of points.
"""

from __future__ import annotations

from modt.types.arrays import N_REFLECTANCE, NONE, UNRECORDED, Bool, Float32, Float64, Int, Int8, Self
from modt.types.budget import UNLIMITED, Budget
from modt.types.columns import Columns, column
from modt.types.frame import COMPENSATED, DESKEWED, NO_TURN, Frame
from modt.types.proposals import LEFT_OUT, OBSTACLES, Cut, PointKind, Proposals, copy_runs, sort_members
from modt.types.result import FrameResult
from modt.types.tracks import (
    MOTION_NAMES,
    Decisions,
    Evidence,
    Motion,
    MotionState,
    ObjectBoxes,
    Requests,
    TrackedFrame,
    Tracks,
)
from modt.types.trust import TRUSTED, Reason, Trust, TrustLevel

__all__ = [
    "COMPENSATED",
    "DESKEWED",
    "LEFT_OUT",
    "MOTION_NAMES",
    "NONE",
    "NO_TURN",
    "N_REFLECTANCE",
    "OBSTACLES",
    "TRUSTED",
    "UNLIMITED",
    "UNRECORDED",
    "Bool",
    "Budget",
    "Columns",
    "Cut",
    "Decisions",
    "Evidence",
    "Float32",
    "Float64",
    "Frame",
    "FrameResult",
    "Int",
    "Int8",
    "Motion",
    "MotionState",
    "ObjectBoxes",
    "PointKind",
    "Proposals",
    "Reason",
    "Requests",
    "Self",
    "TrackedFrame",
    "Tracks",
    "Trust",
    "TrustLevel",
    "column",
    "copy_runs",
    "sort_members",
]
