"""Centres of whole objects, beyond their visible faces."""

from __future__ import annotations

import numpy as np

from modt.class_sizes import IS_PERSON, IS_WALKER
from modt.object_box.seen import Seen, in_world
from modt.object_box.tuning import CentreTuning
from modt.object_box.vectors import along_and_left, dot
from modt.types import Float64, Motion, ObjectBoxes, Proposals

MIN_RANGE_M2 = 1e-6
"""Square of the least distance of a centroid from the sensor [m2]."""


def whole_centre(
    state: ObjectBoxes,
    motion: Motion,
    seen: Seen,
    proposals: Proposals,
    T_world_sensor: Float64,
    middle: Float64,
    extent_m: Float64,
    size_m: Float64,
    tuning: CentreTuning,
) -> Float64:
    """(R, 2) centres of the boxes [m, world].

    Along each axis the unseen part of a car lies beyond the visible one, as seen from the sensor. Where the
    sensor is abreast of the visible part, it lies on both sides. The axis of a person's body lies beyond the
    centroid, which arms and legs move little. The centre follows gradually, and the box keeps holding the
    visible part.

    Args:
        state: headings and former centres.
        motion: the tracks as the tracker leaves them.
        seen: what the frame shows.
        proposals: proposals of the frame.
        T_world_sensor: (4, 4) pose of the sensor.
        middle: (R, 2) middles of the visible parts [m, world].
        extent_m: (R, 3) their extents [m].
        size_m: (R, 3) sizes of the objects [m].
        tuning: depth of bodies, and how fast centres follow.
    """
    unseen_m = np.maximum(size_m[:, :2] - extent_m[:, :2], 0.0) / 2
    reach_m = np.maximum(size_m[:, :2] / 2, tuning.min_reach_m)
    ray = along_and_left(state.heading, middle - T_world_sensor[:2, 3])
    beyond = np.clip(ray / reach_m, -1.0, 1.0) * unseen_m
    body = along_and_left(state.heading, _body(seen, proposals, T_world_sensor, tuning) - middle)
    wanted = np.where(IS_PERSON[seen.object_class][:, None], body, beyond)
    former = along_and_left(state.heading, motion.x[seen.rows, :2] + state.centre_offset - middle)
    followed = np.where(state.estimated[:, None], former + tuning.gain * (wanted - former), wanted)
    room_m = unseen_m + tuning.slack_m
    u, v = np.clip(followed, -room_m, room_m).T
    c, s = state.heading.T
    centre: Float64 = middle + np.stack([c * u - s * v, s * u + c * v], axis=1)
    return centre


def _body(seen: Seen, proposals: Proposals, T_world_sensor: Float64, tuning: CentreTuning) -> Float64:
    """(R, 2) points beyond the centroids, where the axes of people's bodies are [m, world]."""
    centroid = proposals.centroid.take(seen.proposal, axis=0)[:, :2]
    depth_m = np.where(IS_WALKER[seen.object_class], tuning.pedestrian_depth_m, tuning.cyclist_depth_m)
    share = 1 + depth_m / np.sqrt(np.maximum(dot(centroid, centroid), MIN_RANGE_M2))
    return in_world(seen, proposals, share[:, None] * centroid, T_world_sensor)
