"""Boxes and velocities of the reported objects of a frame beside the labelled ones (docs/evaluation.md)."""

from __future__ import annotations

from importlib.util import find_spec

import numpy as np

from modt.geometry import transform_boxes, wrap
from modt.types import NONE, Bool, Float64, Int
from modt_evaluation.frame import JudgedFrame
from modt_evaluation.rows import REPORTED, Rows, table
from modt_evaluation.truth import Role

MATCH_M = 2.0
"""Distance of the centres, seen from above, below which a reported object stands for a labelled one, as nuScenes."""
MATCH_RANGE_M = 50.0
"""Distance up to which the errors of boxes are judged."""


def reported_rows(frame: JudgedFrame, objects: Rows, to_report: Bool, drive: int) -> Rows:
    """Rows of the reported objects of a frame, none where their boxes are not known.

    Args:
        frame: results and truth.
        objects: rows of the n labelled objects.
        to_report: (P,) whether each proposal is judged for its reported class.
        drive: number of the drive.
    """
    if frame.box is None or frame.velocity is None:
        return table(REPORTED, 0)
    chosen = np.flatnonzero(frame.reported > 0)
    truth = frame.truth
    box = transform_boxes(truth.T_box_sensor, frame.box[chosen])
    class_ = frame.reported[chosen]
    rows = table(
        REPORTED,
        len(chosen),
        **{"class": class_},
        drive=drive,
        frame=frame.index,
        track=frame.track[chosen],
        score=frame.posterior[chosen, class_],
        to_report=to_report[frame.of_track[chosen]],
        object=NONE,
        velocity=frame.velocity[chosen],
    )
    for error in ("centre_m", "shape", "heading_rad"):
        rows[error] = np.nan
    counted = (truth.role == Role.COUNTED) & (objects["range_m"] <= MATCH_RANGE_M)
    distance = np.hypot(*(box[:, None, :2] - truth.box[None, :, :2]).transpose(2, 0, 1))
    allowed = (class_[:, None] == truth.object_class) & counted & (distance < MATCH_M)
    k, i = greedy_pairs(distance, allowed)
    rows["object"][k] = truth.id[i]
    rows["centre_m"][k] = distance[k, i]
    rows["shape"][k] = 1 - aligned_iou(box[k, 3:6], truth.box[i, 3:6])
    rows["heading_rad"][k] = np.abs(wrap(box[k, 6] - truth.box[i, 6]))
    _overlap(rows, box, distance, frame, objects)
    return rows


def _overlap(rows: Rows, box: Float64, distance: Float64, frame: JudgedFrame, objects: Rows) -> None:
    """Write the intersection over union with the labelled object of the class that each box (k, 7) is paired with.

    Distances of the centres are (k, n) [m].
    """
    if find_spec("shapely") is None or not len(rows) or not len(objects):
        return
    from modt_evaluation.box_tracking.sequences import iou_3d

    truth = frame.truth
    near = distance < MATCH_M + truth.box[:, 3] / 2
    allowed = near & (rows["class"][:, None] == truth.object_class)
    k, i = np.nonzero(allowed)
    iou = np.zeros(allowed.shape)
    iou[k, i] = iou_3d(box[k], truth.box[i])
    k, i = greedy_pairs(-iou, iou > 0)
    rows["iou"][k] = iou[k, i]
    rows["iou_judged"][k] = objects["to_classify"][i]


def greedy_pairs(cost: Float64, allowed: Bool) -> tuple[Int, Int]:
    """Rows and columns of the allowed pairs that are taken, the cheapest first, no row and no column twice."""
    rows, columns = np.nonzero(allowed)
    taken: list[tuple[int, int]] = []
    used_rows: set[int] = set()
    used_columns: set[int] = set()
    for pair in np.argsort(cost[rows, columns], kind="stable").tolist():
        row = int(rows[pair])
        column = int(columns[pair])
        if row not in used_rows and column not in used_columns:
            used_rows.add(row)
            used_columns.add(column)
            taken.append((row, column))
    pairs = np.array(taken, np.int64).reshape(-1, 2)
    return pairs[:, 0], pairs[:, 1]


def aligned_iou(a: Float64, b: Float64) -> Float64:
    """(n,) intersection over union of boxes of sizes (n, 3) with the same centre and heading."""
    common = np.minimum(a, b).prod(axis=1)
    iou: Float64 = common / np.maximum(a.prod(axis=1) + b.prod(axis=1) - common, 1e-9)
    return iou
