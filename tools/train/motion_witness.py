"""Count the table of the motion witness on simulated drives.

    python -m tools.train.motion_witness

Prints LOG_LIKELIHOOD_RATIO of modt.classification.motion_likelihood in tenths.
"""

from __future__ import annotations

import numpy as np

from modt.classes import N_CLASSES
from modt.classification.motion_likelihood import LENGTH_M, MOVED_M, YOUNG_S, cells
from modt.types import Float64, Int
from modt_evaluation.evaluation import collect
from modt_evaluation.frame import JudgedFrame
from modt_simulation.sensors import SENSORS
from tools.options import parser
from tools.study.drives import Drive, simulated, steps_of

CELLS = len(YOUNG_S) + 1 + len(MOVED_M)
WEIGHT = 0.5
"""Weight of the motion beside network and box."""
MOST = 1.5
"""Greatest absolute log likelihood ratio of the motion."""
SMOOTHING = 200
"""Counts of a class over all lengths that are added to those of one length."""
FRAGMENTS = 0
"""Length for which the length itself is evidence, since hardly any object is never seen longer."""
JOINT_SMOOTHING = 50
"""Counts that are added to a class there, over all lengths."""
SCENES = ("street", "crossing")
SEEDS = range(800, 806)
"""Seeds of the drives that are counted, by every sensor; they are not those of any published figure."""
SECONDS = 8.0
"""Duration of each drive [s]."""


def counted(drive: Drive, number: int) -> Int:
    """(4, CELLS, C) tracks of a drive, frame by frame, by length, cell and true class."""
    step = steps_of("accurate", drive.profile, drive.fov)
    results = [step(frame) for frame, _ in drive.frames]
    judged = (JudgedFrame.of_result(r, truth, drive.fov) for r, (_, truth) in zip(results, drive.frames, strict=True))
    rows = collect(judged, drive.rules, number).proposals
    counts = np.zeros((len(LENGTH_M) + 1, CELLS, N_CLASSES), np.int64)
    for result in results:
        tracks = result.tracks
        found = rows[(rows["frame"] == result.frame.index) & rows["to_classify"]]
        of = np.searchsorted(tracks.id, found["track"])
        length, cell = cells(tracks.moved_m[of], tracks.observed_s[of], tracks.size_m[of, 0])
        np.add.at(counts, (length, cell, found["label"]), 1)
    return counts


def log_likelihood_ratio(counts: Int) -> Float64:
    """(4, C - 1, CELLS) by length and class but background, of counts (4, CELLS, C)."""
    overall = (counts.sum(axis=0) + 1.0) / (counts.sum(axis=0) + 1.0).sum(axis=0)
    smooth = counts + SMOOTHING * overall
    log = np.log(smooth / smooth.sum(axis=1, keepdims=True))
    joint = counts + JOINT_SMOOTHING / len(counts) * overall
    log[FRAGMENTS] = np.log(joint / joint.sum(axis=(0, 1)))[FRAGMENTS]
    ratio = WEIGHT * (log[:, :, 1:] - log[:, :, :1])
    limited: Float64 = np.clip(ratio, -MOST, MOST).transpose(0, 2, 1)
    return limited


def main() -> None:
    parser(__doc__).parse_args()
    drives = [(scene, sensor, SECONDS, seed) for sensor in SENSORS for scene in SCENES for seed in SEEDS]
    counts = sum(counted(simulated(*drive), k) for k, drive in enumerate(drives))
    print(np.round(10 * log_likelihood_ratio(np.asarray(counts))).astype(int).tolist())


if __name__ == "__main__":
    main()
