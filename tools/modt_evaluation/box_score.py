"""Errors of boxes and velocities by nuScenes' definitions, and KITTI's average precision of boxes."""

from __future__ import annotations

from dataclasses import dataclass
from importlib.util import find_spec

import numpy as np

from modt.class_sizes import IS_VEHICLE
from modt.classes import CLASS_NAMES
from modt.types import Bool, Float64
from modt_evaluation.class_score import envelope, precision_recall
from modt_evaluation.rows import Rows
from modt_evaluation.truth import CLASSIFIED, Role

MOVING_MPS = 1.0
"""Speed from which an object counts as moving."""
VELOCITY_FRAMES = 2
"""The true velocity is the displacement from so many frames before to so many frames after, over that time."""
STRICT_IOU = [0.7 if vehicle else 0.5 for vehicle in IS_VEHICLE]
LOOSE_IOU = [0.5 if vehicle else 0.25 for vehicle in IS_VEHICLE]
"""Intersection over union from which a box is right, as KITTI."""
RECALLS = np.arange(1, 41) / 40
"""Recalls over which precision is averaged, as KITTI."""


@dataclass(frozen=True)
class BoxScore:
    """Boxes and velocities of one class; means over the reported objects that stand for a labelled one."""

    matched: int  # reported objects that stand for one of their class
    translation_m: float | None  # ATE: distance of the centres in the ground plane
    scale: float | None  # ASE: 1 - intersection over union of the boxes, aligned
    orientation_rad: float | None  # AOE: difference of the headings
    axis_rad: float | None  # the same where front and rear count as alike
    velocity_mps: float | None  # AVE: length of the difference of the velocities
    moving: int  # number of them that move
    velocity_moving_mps: float | None  # AVE of these
    strict_ap: float | None  # average precision of boxes in 3D at STRICT_IOU; None without shapely
    loose_ap: float | None  # the same at LOOSE_IOU


def box_scores(objects: Rows, reported: Rows) -> dict[str, BoxScore]:
    """The score of each class."""
    velocity = true_velocities(objects)
    scores = {}
    for c, name in enumerate(CLASS_NAMES[1:], 1):
        of_class = reported[reported["class"] == c]
        matched = of_class[np.isfinite(of_class["centre_m"])]
        keys = matched[["drive", "object", "frame"]].tolist()
        true = np.array([velocity.get(key, (np.nan, np.nan)) for key in keys]).reshape(-1, 2)
        error = np.hypot(*(matched["velocity"] - true).T)
        moving = np.hypot(*true.T) > MOVING_MPS
        heading = matched["heading_rad"]
        wanted = objects["to_classify"] & (objects["class"] == c) & np.isin(objects["role"], CLASSIFIED)
        n = int(wanted.sum())
        scores[name] = BoxScore(
            matched=len(matched),
            translation_m=_mean(matched["centre_m"]),
            scale=_mean(matched["shape"]),
            orientation_rad=_mean(heading),
            axis_rad=_mean(np.minimum(heading, np.pi - heading)),
            velocity_mps=_mean(error),
            moving=int(moving.sum()),
            velocity_moving_mps=_mean(error[moving]),
            strict_ap=average_precision(of_class, STRICT_IOU[c], n),
            loose_ap=average_precision(of_class, LOOSE_IOU[c], n),
        )
    return scores


def true_velocities(objects: Rows) -> dict[tuple[int, int, int], Float64]:
    """Velocity of each object in each frame, by drive, identity and frame [m/s, world of the run].

    It is the displacement between the farthest frames within VELOCITY_FRAMES; without two of them there is none.
    """
    paths: dict[tuple[int, int], dict[int, tuple[float, Float64]]] = {}
    for row in objects[(objects["role"] == Role.COUNTED) & (objects["id"] >= 0)]:
        path = paths.setdefault((int(row["drive"]), int(row["id"])), {})
        path[int(row["frame"])] = float(row["stamp_s"]), row["position"]
    found = {}
    for (drive, id_), path in paths.items():
        for frame in path:
            near = [f for f in range(frame - VELOCITY_FRAMES, frame + VELOCITY_FRAMES + 1) if f in path]
            before_s, before = path[near[0]]
            after_s, after = path[near[-1]]
            if after_s > before_s:
                found[drive, id_, frame] = (after - before) / (after_s - before_s)
    return found


def average_precision(reported: Rows, min_iou: float, n: int) -> float | None:
    """Area under precision over recall of n objects, at KITTI's 40 recalls; None without objects or shapely.

    What overlaps an object that is not judged, or stands where nothing is judged, is left out.
    """
    if not n or find_spec("shapely") is None:
        return None
    right = reported["iou"] >= min_iou
    judged: Bool = np.where(right, reported["iou_judged"], reported["to_report"])
    _, precision, recall = precision_recall(reported["score"][judged], right[judged], n)
    first = np.searchsorted(recall, RECALLS - 1e-9)
    return float(np.append(envelope(precision), 0.0)[first].mean())


def _mean(values: Float64) -> float | None:
    """Mean of the finite values, None without any."""
    finite = values[np.isfinite(values)]
    return float(finite.mean()) if len(finite) else None
