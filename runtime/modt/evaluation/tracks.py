"""Tracks against truth by the field's metrics: HOTA, CLEAR and Identity, as TrackEval computes them.

TrackEval's own loader for KITTI compares boxes in the image. Here the similarity is that of the boxes in space.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from modt.errors import MisuseError
from modt.geometry.overlap import birds_eye_iou, iou_3d
from modt.types import Float64, Int

THRESHOLD = 0.25
"""Similarity from which CLEAR and Identity count a match."""

Similarity = Callable[[Float64, Float64], Float64]
"""Of boxes (n, 7) and (n, 7), row by row, from 0 to 1: iou_3d or birds_eye_iou."""

SIMILARITIES: dict[str, Similarity] = {"3d": iou_3d, "birds-eye": birds_eye_iou}


@dataclass(frozen=True, slots=True)
class Labelled:
    """The objects of one frame.

    Attributes:
        id: (n,) identities.
        box: (n, 7) boxes.
    """

    id: Int
    box: Float64


def evaluate(
    sequences: Sequence[tuple[Sequence[Labelled], Sequence[Labelled]]], similarity: Similarity = iou_3d
) -> dict[str, float]:
    """HOTA, DetA, AssA, MOTA, IDF1 [percent], switches and fragmentations over all sequences.

    Args:
        sequences: of each, its frames' truth and its frames' results, frame by frame.
        similarity: of boxes.

    Raises:
        MisuseError: trackeval is not installed.
    """
    try:
        from trackeval.metrics import CLEAR, HOTA, Identity
    except ImportError:
        raise MisuseError("trackeval", "is not installed", "pip install 'modt[evaluate]'") from None
    options = {"THRESHOLD": THRESHOLD, "PRINT_CONFIG": False}
    data = [_data(truth, results, similarity) for truth, results in sequences]
    data = [d for d in data if d["num_gt_dets"]]
    if not data:
        return {}
    found = {}
    for metric in (HOTA(), CLEAR(options), Identity(options)):
        parts = {str(i): metric.eval_sequence(d) for i, d in enumerate(data)}
        found.update(metric.combine_sequences(parts))
    percent = {name: 100 * float(np.mean(found[name])) for name in ("HOTA", "DetA", "AssA", "MOTA", "IDF1")}
    return percent | {"switches": float(found["IDSW"]), "fragmentations": float(found["Frag"])}


def _data(truth: Sequence[Labelled], results: Sequence[Labelled], similarity: Similarity) -> dict[str, Any]:
    """What TrackEval's metrics take."""
    names_of_truth, truth_ids = _renumbered(truth)
    names_of_results, result_ids = _renumbered(results)
    return {
        "gt_ids": truth_ids,
        "tracker_ids": result_ids,
        "similarity_scores": [_matrix(t.box, r.box, similarity) for t, r in zip(truth, results, strict=True)],
        "num_gt_dets": sum(map(len, truth_ids)),
        "num_tracker_dets": sum(map(len, result_ids)),
        "num_gt_ids": names_of_truth,
        "num_tracker_ids": names_of_results,
        "num_timesteps": len(truth),
    }


def _renumbered(frames: Sequence[Labelled]) -> tuple[int, list[Int]]:
    """How many identities there are, and those of each frame without gaps."""
    ids = np.concatenate([np.zeros(0, np.int64), *(f.id for f in frames)])
    names, number = np.unique(ids, return_inverse=True)
    ends = np.cumsum([len(f.id) for f in frames])
    return len(names), np.split(number, ends[:-1])


def _matrix(a: Float64, b: Float64, similarity: Similarity) -> Float64:
    """(n, k) similarity of every pair."""
    i, j = np.divmod(np.arange(len(a) * len(b)), max(len(b), 1))
    return similarity(a[i], b[j]).reshape(len(a), len(b))
