"""Published objects of a frame: those of a class, those that move, and those that may be persons."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from modt.class_sizes import unknown_near
from modt.classes import CLASS_NAMES, CLASSES, N_CLASSES, ObjectClass
from modt.geometry import inverse, rotation_zyx, transform_boxes, yaw_of
from modt.types import Bool, Float64, FrameResult, Int, MotionState

OTHER = N_CLASSES
"""Kind of what moves and is of no class."""
UNKNOWN_NEAR = N_CLASSES + 1
"""Kind of what is of no class, but too near to rule out a person."""
KIND_NAMES = (*CLASS_NAMES, "other", "unknown_near")
KIND_COLOURS = (*(spec.colour for spec in CLASSES), "#9c36b5", "#f08c00")


def kinds(result: FrameResult) -> Int:
    """(M,) what each track is taken for: index in KIND_NAMES. Those of 0, background, are not published."""
    tracks = result.tracks
    kind = tracks.object_class.copy()
    kind[unknown_near(result)] = UNKNOWN_NEAR
    moving = tracks.motion == MotionState.MOVING.value
    kind[moving & (tracks.object_class == ObjectClass.BACKGROUND.value)] = OTHER
    return kind


@dataclass(frozen=True)
class PublishedObjects:
    """The published tracks of a frame, n rows, in the level frame at the place of the sensor."""

    rows: Int  # (n,) row of each in the tracks
    id: Int  # (n,)
    kind: Int  # (n,) index in KIND_NAMES
    posterior: Float64  # (n, 4)
    existence: Float64  # (n,) probability that it is an object or moves
    box: Float64  # (n, 7) the whole object: x, y, z, l, w, h [m], yaw [rad]
    heading_known: Bool  # (n,) whether the yaw of the box is that of its front, else it may be turned round
    motion: Int  # (n,) value of MotionState
    velocity: Float64  # (n, 2) over ground [m/s]
    velocity_covariance: Float64  # (n, 2, 2) [m2/s2]
    position_covariance: Float64  # (n, 2, 2) [m2]
    heading_variance: Float64  # (n,) [rad2]

    def __len__(self) -> int:
        return len(self.rows)


def published_objects(result: FrameResult, background: bool = False) -> PublishedObjects:
    """Published objects of a frame; with `background` everything in view."""
    tracks = result.tracks
    kind = kinds(result)
    rows = np.flatnonzero(tracks.observed & (background | (kind > 0)))
    yaw = yaw_of(result.T_world_sensor)
    R_level_world = rotation_zyx(0.0, 0.0, -yaw)[:2, :2]
    R_world_level = R_level_world.T
    posterior = tracks.posterior[rows]
    P = tracks.P[rows]
    return PublishedObjects(
        rows=rows,
        id=tracks.id[rows],
        kind=kind[rows],
        posterior=posterior,
        existence=np.maximum(1.0 - posterior[:, ObjectClass.BACKGROUND], tracks.moving_probability[rows]),
        box=transform_boxes(inverse(result.T_world_sensor), tracks.whole_box[rows]),
        heading_known=tracks.heading_known[rows],
        motion=tracks.motion[rows],
        velocity=tracks.velocity[rows] @ R_world_level,
        velocity_covariance=R_level_world @ tracks.velocity_covariance[rows] @ R_world_level,
        position_covariance=R_level_world @ P[:, :2, :2] @ R_world_level,
        heading_variance=P[:, 2, 2],
    )
