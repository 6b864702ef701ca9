"""Truth of the frames of a run, and the outcome of each object."""

from __future__ import annotations

from typing import Any

import numpy as np

from modt.errors import MisuseError
from modt.geometry import inverse, transform_boxes
from modt.sinks.tracks import BOX_KEYS
from modt.sources.stream import Stream
from modt.types import NONE, Float32, Int
from modt.viewer.theme import COLOURS, Entry
from modt_evaluation.matching import judge
from modt_evaluation.overlap import inside
from modt_evaluation.rows import Rows
from modt_evaluation.run_record import LABELS, RunRecord
from modt_evaluation.truth import FrameTruth, Truth

MARGIN_M = 0.02
"""Margin around the boxes of proposals, because they are rounded."""
MISSED = "#d6177f"
"""Colour of missed objects, whose outline is dotted."""
FALSE = "#a86a00"
"""Colour of false tracks, whose box is crossed out."""
_OUTCOMES = {"found": COLOURS[7], "missed": MISSED, "not judged": COLOURS[5], "false": FALSE}
LEGEND: dict[str, Entry] = {name: {"name": name, "colour": colour} for name, colour in _OUTCOMES.items()}
"""Outcomes of labelled objects; `false`: tracks that are reported as a wrong class."""
DRAWN = [BOX_KEYS.index(key) for key in ("x", "y", "l", "w", "yaw")]


def truth_marks(run: RunRecord, truth: Truth, stream: Stream | None) -> dict[int, dict[str, Any]]:
    """Map each labelled frame, by number, to `truth`, its objects, and `false`, ids of tracks of a wrong class.

    Judged as by modt evaluate; where the run was made without --labels, a proposal has the points in its box.

    Args:
        run: run that is judged.
        truth: truth by the numbers of the frames of the run.
        stream: stream of the run; None if it is not found, then the scans of the truth are used.

    Raises:
        MisuseError: the labels are not those of the run's recording.
    """
    exact = (run.path / LABELS).is_dir()
    marks = {}
    labelled = ((place, record) for place, record in run.records() if record["frame"] in truth.frames)
    for frame in run.frames(truth, None if exact else points_in_boxes, stream, labelled):
        rows = judge(frame, truth.rules)
        called = rows.proposals[rows.proposals["to_report"] & (rows.proposals["reported"] > 0)]
        false = called["track"][called["reported"] != called["box_class"]]
        marks[frame.index] = {"truth": _objects(frame.truth, rows.objects), "false": false.tolist()}
    if not marks:
        cause = f"none of its frames is in the truth, which has {len(truth.frames)}"
        raise MisuseError(run.path, cause, "give the truth of the run's own recording")
    return marks


def _objects(truth: FrameTruth, rows: Rows) -> list[dict[str, Any]]:
    """Objects of a class in the frame of the sensor; found: detected with the right class."""
    boxes = transform_boxes(inverse(truth.T_box_sensor), truth.box)[:, DRAWN]
    found = rows["reported"] == rows["class"]
    outcome = np.where(found, "found", np.where(rows["to_segment"] & rows["to_classify"], "missed", "not judged"))
    columns = zip(boxes.tolist(), rows["class"].tolist(), outcome.tolist(), strict=True)
    names = [BOX_KEYS[k] for k in DRAWN]
    return [dict(zip(names, box, strict=True)) | {"class": c, "outcome": o} for box, c, o in columns if c]


def points_in_boxes(record: dict[str, Any], points: Float32) -> Int:
    """(N,) proposal of each point, by the boxes of a record, NONE where it lies in none."""
    # Sorted along x, so that only the points of a strip are compared with each box.
    order = np.argsort(points[:, 0], kind="stable")
    sorted_x = points[order, 0]
    found = np.full(len(points), NONE, np.int64)
    for track in record["tracks"]:
        if track["box"] is not None:
            box = np.array([track["seen"][key] for key in BOX_KEYS])
            reach = np.hypot(box[3], box[4]) / 2 + MARGIN_M
            near = order[slice(*np.searchsorted(sorted_x, [box[0] - reach, box[0] + reach]))]
            found[near[inside(points[near], box, MARGIN_M, -MARGIN_M)]] = track["proposal"]
    return found
