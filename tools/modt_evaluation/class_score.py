"""Scores of classification, by the posterior and by the reported class."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from modt.classes import CLASS_NAMES, N_CLASSES
from modt.types import Bool, Float64, Int
from modt_evaluation.rows import Outcome, Rows, ratio
from modt_evaluation.truth import CLASSIFIED

BINS = 15
"""Number of bins of confidence, all of one width."""
CURVE_RECALLS = np.arange(1, 21) / 20


@dataclass(frozen=True)
class ClassScore:
    """Proposals of one class."""

    objects: int  # number of objects of the class, one count an object and frame
    average_precision: float | None  # area under the envelope of precision over recall
    curve: tuple[tuple[float, float, float], ...]  # threshold, precision, recall at each twentieth of recall
    called: int  # proposals reported as the class
    precision: float | None  # share of them that lie on an object of the class
    objects_called: float | None  # share of the objects whose proposal is reported as the class
    segmentable: int  # objects of the class that are judged for segmentation
    recall: float | None  # share of them that are detected and reported as the class
    recall_of_found: float | None  # share of the detected ones reported as the class
    calibration_error: float | None  # calibration error of the posterior of the class over all judged proposals


def class_scores(objects: Rows, proposals: Rows) -> dict[str, ClassScore]:
    """The score of each class."""
    judged = proposals[proposals["to_classify"]]
    reporting = proposals[proposals["to_report"]]
    scores = {}
    for c, name in enumerate(CLASS_NAMES[1:], 1):
        of_class = objects[(objects["class"] == c) & np.isin(objects["role"], CLASSIFIED)]
        wanted = of_class[of_class["to_segment"]]
        counted = of_class[of_class["to_classify"]]
        n = len(counted)
        correct = _count(wanted["reported"] == c)
        called = reporting[reporting["reported"] == c]
        score = judged["posterior"][:, c]
        hit = judged["label"] == c
        curve = precision_recall(score, hit, n)
        scores[name] = ClassScore(
            objects=n,
            average_precision=_area(*curve[1:]) if n else None,
            curve=_sampled(*curve) if n else (),
            called=len(called),
            precision=ratio(_count(called["box_class"] == c), len(called)),
            objects_called=ratio(_count(counted["reported_by_match"] == c), n),
            segmentable=len(wanted),
            recall=ratio(correct, len(wanted)),
            recall_of_found=ratio(correct, _count(wanted["outcome"] == Outcome.DETECTED)),
            calibration_error=expected_calibration_error(score, hit),
        )
    return scores


def _count(which: Bool) -> int:
    return int(np.count_nonzero(which))


def precision_recall(score: Float64, hit: Bool, n: int) -> tuple[Float64, Float64, Float64]:
    """(R,) descending scores, and precision and recall with each as the threshold, for n objects."""
    order = np.argsort(-score, kind="stable")
    true = np.cumsum(hit[order])
    return score[order], true / np.arange(1, len(true) + 1), true / max(n, 1)


def envelope(precision: Float64) -> Float64:
    """Greatest precision at each recall or a greater one, along the last axis."""
    return np.asarray(np.maximum.accumulate(precision[..., ::-1], axis=-1)[..., ::-1])


def _area(precision: Float64, recall: Float64) -> float:
    return float(np.sum(np.diff(recall, prepend=0.0) * envelope(precision)))


def _sampled(threshold: Float64, precision: Float64, recall: Float64) -> tuple[tuple[float, float, float], ...]:
    at = np.searchsorted(recall, CURVE_RECALLS - 1e-9)
    at = np.unique(at[at < len(recall)])
    return tuple(zip(threshold[at].tolist(), precision[at].tolist(), recall[at].tolist(), strict=True))


def average_precision(probability: Float64, label: Int, truth: Int) -> dict[str, float]:
    """Area under the precision-recall curve of each class, given (R, 4) posteriors and (R,) classes of proposals.

    An object without a proposal is a false negative; truth is the (4,) number of objects of each class.
    """
    curves = (precision_recall(probability[:, c], label == c, int(truth[c])) for c in range(1, N_CLASSES))
    return {name: round(_area(*curve[1:]), 4) for name, curve in zip(CLASS_NAMES[1:], curves, strict=True)}


def expected_calibration_error(confidence: Float64, correct: Bool) -> float | None:
    """Mean distance of confidence from accuracy, over BINS of confidence weighted by their size (Naeini, 2015)."""
    if not len(confidence):
        return None
    bins = np.minimum((confidence * BINS).astype(np.int64), BINS - 1)
    gap = np.bincount(bins, confidence - correct, BINS)
    return float(np.abs(gap).sum() / len(confidence))


def top_calibration_error(posterior: Float64, label: Int) -> float | None:
    """Expected calibration error of the most probable class of (R, 4) posteriors."""
    return expected_calibration_error(posterior.max(axis=1, initial=0), posterior.argmax(axis=1) == label)
