"""Small frames with known answers."""

import numpy as np

from modt.classes import CLASS_NAMES
from modt_evaluation.evaluation import Evaluation, collect, evaluation
from modt_evaluation.frame import JudgedFrame
from modt_evaluation.rules import KITTI_RULES
from modt_evaluation.truth import KITTI_TYPES, FrameTruth

CERTAIN = {name: np.eye(4)[k] * 0.96 + 0.01 for k, name in enumerate(CLASS_NAMES)}


def car(x: float, y: float = 0.0) -> list[float]:
    """A box whose foot stands 1.7 m below the sensor."""
    return [x, y, -0.95, 4.0, 2.0, 1.5, 0.0]


def blob(n: int, x: float, y: float = 0.0) -> np.ndarray:
    """(n, 4) points within 0.5 m of a place, half a metre and more above the foot."""
    t = np.linspace(0, 1, n)
    return np.c_[x + t - 0.5, np.full(n, y), -1.2 + 0.5 * t, np.zeros(n)].astype(np.float32)


def frame(truth, blobs, tracks, *, index=0, classified=0, posteriors=None, **more) -> JudgedFrame:
    """Blobs of points with their proposals; tracks as identity, proposal and class, which is almost certain."""
    points = np.concatenate([np.zeros((0, 4), np.float32), *(points for points, _ in blobs)])
    proposal = np.concatenate([np.zeros(0, np.int64), *(np.full(len(points), k) for points, k in blobs)])
    ids, of_track, names = zip(*tracks, strict=True) if tracks else ((), (), ())
    return JudgedFrame(
        index=index,
        points=points,
        proposal=proposal,
        n_proposals=int(proposal.max(initial=-1)) + 1,
        classified=classified,
        track=np.array(ids, np.int64),
        of_track=np.array(of_track, np.int64),
        reported=np.array([CLASS_NAMES.index(name) for name in names], np.int64),
        posterior=np.array([CERTAIN[n] for n in names]).reshape(-1, 4) if posteriors is None else posteriors,
        truth=truth,
        **more,
    )


def cars(*places: float, first_id: int = 0, **more) -> FrameTruth:
    """Cars ahead."""
    ids = list(range(first_id, first_id + len(places)))
    return FrameTruth.of(KITTI_TYPES, ids, ["Car"] * len(places), [car(x) for x in places], **more)


def score(frames, rules=KITTI_RULES) -> Evaluation:
    """The evaluation of one drive."""
    return evaluation([collect(frames, rules)])
