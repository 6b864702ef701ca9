"""The tracks of a run as one table of integers: a row a track and frame."""

from __future__ import annotations

import numpy as np

from modt.classes import CLASS_NAMES
from modt.geometry import inverse, transform_boxes, wrap, yaw_of
from modt.publication import kinds
from modt.sinks.tracks import BOX_KEYS, WORLD_KEYS
from modt.types import NONE, Float64, FrameResult, Int

PLAIN = ("id", "at", "state", "class", "seen", "final", "classified", "points", "motion")
P = tuple(f"p_{name}" for name in CLASS_NAMES)
WITNESS = tuple(f"motion_{name}" for name in CLASS_NAMES)
WORLD = tuple(f"world_{key}" for key in WORLD_KEYS)
SCALED = (*P, *WITNESS, *BOX_KEYS, *WORLD)
COLUMNS = (*PLAIN, *SCALED)
"""`at` is the index of the frame in the run, `class` the kind as in modt.publication, `motion` a MotionState,
`seen` whether it has a proposal. Probabilities are per mille, lengths [cm], angles [mrad], speeds [cm/s];
`motion_CLASS` the log-likelihood of the motion over that of background [1/100].
Boxes are of the whole object; that of a lost track is its last one, moved to where the filter predicts it."""
SCALE = {name: 1000 if name in (*P, "yaw", "world_heading") else 100 for name in SCALED}


def planar(T_world_sensor: Float64) -> Float64:
    """(3,) x, y [m], yaw [rad] of a pose."""
    return np.array([*T_world_sensor[:2, 3], yaw_of(T_world_sensor)])


def scaled(rows: Float64) -> Int:
    """Rows in the units of the table."""
    rows[:, len(PLAIN) :] *= [SCALE[name] for name in SCALED]
    return np.rint(rows).astype(np.int64)


def result_rows(result: FrameResult) -> Float64:
    """(M, COLUMNS) rows of the tracks of a result, at frame 0."""
    tracks = result.tracks
    pose = planar(result.T_world_sensor)
    # The box of a lost track: its last one in the world, at the predicted position, seen from the sensor
    box = tracks.whole_box - [0, 0, result.T_world_sensor[2, 3], 0, 0, 0, 0]
    cos = np.cos(pose[2])
    sin = np.sin(pose[2])
    dx, dy = (tracks.x[:, :2] - pose[:2]).T
    box[:, 0] = cos * dx + sin * dy
    box[:, 1] = cos * dy - sin * dx
    box[:, 6] = wrap(box[:, 6] - pose[2])
    seen = tracks.proposal != NONE
    box[seen] = transform_boxes(inverse(result.T_world_sensor), tracks.whole_box[seen])
    plain = (
        tracks.id,
        np.zeros(len(tracks)),
        tracks.state,
        kinds(result),
        seen,
        tracks.final,
        np.isin(tracks.id, result.classified),
        tracks.points,
        tracks.motion,
    )
    return np.column_stack([*plain, tracks.posterior, tracks.motion_evidence, box, tracks.x]).astype(np.float64)
