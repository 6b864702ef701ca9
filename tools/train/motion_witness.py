"""Count the table of the motion witness on simulated drives.

    python -m tools.train.motion_witness [--sensors NAME ...] [--scene NAME ...] [--seeds 800:806] [--seconds 8]

Prints LOG_LIKELIHOOD_RATIO of modt.classification.motion_witness in tenths. Seeds of the documents' tables (450 to
452) are refused.
"""

from __future__ import annotations

import numpy as np

from modt.app import assembly
from modt.classes import N_CLASSES
from modt.classification.motion_witness import LENGTH_M, MOVED_M, YOUNG_S, cells
from modt.cli.options import frames as number_range
from modt.types import Float64, Int
from modt_desk.evaluation.evaluation import collect
from modt_desk.evaluation.frame import JudgedFrame
from modt_desk.simulation.sensors import SENSORS
from tools.options import parser
from tools.study.drives import Drive, simulated

CELLS = len(YOUNG_S) + 1 + len(MOVED_M)
WEIGHT, MOST = 0.5, 1.5
"""Weight of the witness beside network and box; its greatest absolute logarithm."""
SMOOTHING = 200
"""Counts of a class over all lengths that are added to those of one length."""
TEST_SEEDS = range(450, 453)


def counted(drive: Drive, number: int) -> Int:
    """(3, CELLS, 4) tracks of a drive, frame by frame, by length, cell and true class."""
    mode = assembly.MODES["accurate"]
    pipeline, budget = assembly.pipeline(mode, drive.profile, drive.fov), mode.budget(drive.profile)
    results = [pipeline.step(frame, budget) for frame, _ in drive.frames]
    judged = (JudgedFrame.of_result(r, truth, drive.fov) for r, (_, truth) in zip(results, drive.frames, strict=True))
    rows = collect(judged, drive.rules, number).proposals
    counts = np.zeros((len(LENGTH_M) + 1, CELLS, N_CLASSES), np.int64)
    for result in results:
        tracks = result.tracks
        found = rows[(rows["frame"] == result.frame.index) & rows["to_classify"]]
        of = np.searchsorted(tracks.id, found["track"])
        length, cell = cells(tracks.moved_m[of], tracks.observed_s[of], tracks.length_m[of])
        np.add.at(counts, (length, cell, found["label"]), 1)
    return counts


def log_likelihood_ratio(counts: Int) -> Float64:
    """(3, 3, CELLS) by length and class but background, of counts (3, CELLS, 4)."""
    overall = (counts.sum(axis=0) + 1.0) / (counts.sum(axis=0) + 1.0).sum(axis=0)
    smooth = counts + SMOOTHING * overall
    log = np.log(smooth / smooth.sum(axis=1, keepdims=True))
    ratio = WEIGHT * (log[:, :, 1:] - log[:, :, :1])
    limited: Float64 = np.clip(ratio, -MOST, MOST).transpose(0, 2, 1)
    return limited


def main() -> None:
    options = parser(__doc__)
    options.add_argument("--sensors", nargs="+", choices=SENSORS, default=list(SENSORS))
    options.add_argument("--scene", nargs="+", default=["street", "crossing"])
    options.add_argument("--seeds", type=number_range, default=(800, 806), metavar="A:B")
    options.add_argument("--seconds", type=float, default=8.0)
    args = options.parse_args()
    seeds = range(*args.seeds)
    if set(seeds) & set(TEST_SEEDS):
        options.error("seeds 450 to 452 are those of the documents' tables")
    drives = [(sensor, scene, seed) for sensor in args.sensors for scene in args.scene for seed in seeds]
    counts = sum(
        counted(simulated(scene, sensor, args.seconds, seed), k) for k, (sensor, scene, seed) in enumerate(drives)
    )
    print(np.round(10 * log_likelihood_ratio(np.asarray(counts))).astype(int).tolist())


if __name__ == "__main__":
    main()
