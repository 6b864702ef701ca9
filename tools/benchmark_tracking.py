"""CPU time of the tracker against the number of proposals, on static scenery seen from a sensor that drives.

A machine that is busy or slow is so for everything: each figure is also given relative to a sort of 100,000 numbers,
timed in the same run.
"""

from __future__ import annotations

import argparse
import json
import time

import numpy as np

from modt.config import TrackingConfig
from modt.geometry import inverse, se3, transform_boxes
from modt.tracking.states import EFFICIENT
from modt.tracking.tracker import Tracker
from modt.types import Frame, Proposals

POINTS = 80
"""Points of a proposal."""


def scenery(n: int, rng: np.random.Generator) -> np.ndarray:
    """(n, 7) boxes, as dense as proposals lie in a street."""
    half = 4.0 * np.sqrt(n)
    size = rng.uniform(0.3, 3.0, (n, 3))
    size[:, :2] = np.sort(size[:, :2], axis=1)[:, ::-1]
    return np.c_[rng.uniform(-half, half, (n, 2)), np.full(n, -1.0), size, rng.uniform(-3, 3, n)]


def frames(n: int, count: int, posed: bool, seed: int = 0) -> list[tuple[Frame, Proposals]]:
    """Frames of the scenery, each box seen by points strewn over it."""
    rng = np.random.default_rng(seed)
    world, out = scenery(n, rng), []
    for i in range(count):
        T = se3(np.eye(3), np.array([0.8 * i, 0.0, 0.0]))
        boxes = transform_boxes(inverse(T), world)
        local = rng.uniform(-0.5, 0.5, (n, POINTS, 3)) * boxes[:, None, 3:6]
        c, s = np.cos(boxes[:, 6])[:, None], np.sin(boxes[:, 6])[:, None]
        x, y = c * local[..., 0] - s * local[..., 1], s * local[..., 0] + c * local[..., 1]
        xyz = np.stack([x, y, local[..., 2]], axis=-1) + boxes[:, None, :3]
        points = np.concatenate([xyz.reshape(-1, 3), np.zeros((n * POINTS, 1))], axis=1).astype(np.float32)
        flags = np.zeros(n, np.bool_)
        proposals = Proposals(np.arange(n * POINTS), np.arange(n + 1) * POINTS, xyz.mean(axis=1), boxes, flags, flags)
        out.append((Frame(i, 0.1 * i, points, T if posed else None), proposals))
    return out


def cost_ms(scene: list[tuple[Frame, Proposals]]) -> float:
    """Median CPU time of a frame [ms], the first ones left out."""
    tracker, times = Tracker(TrackingConfig(), EFFICIENT), []
    for frame, proposals in scene:
        began = time.thread_time_ns()
        tracks = tracker.follow(frame, proposals)
        times.append((time.thread_time_ns() - began) / 1e6)
        rows = np.flatnonzero(tracker.asking())
        tracks.posterior[rows], tracks.fixed[rows] = [1, 0, 0, 0], True
        tracker.settle(rows, np.ones(len(rows), np.bool_))
    return float(np.median(times[3:]))


def sort_ms() -> float:
    """Median CPU time of the reference [ms]."""
    numbers, times = np.random.default_rng(0).random(100_000), []
    for _ in range(21):
        began = time.thread_time_ns()
        np.sort(numbers)
        times.append((time.thread_time_ns() - began) / 1e6)
    return float(np.median(times))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--proposals", type=int, nargs="+", default=[50, 100, 150, 250, 500, 1000])
    parser.add_argument("--frames", type=int, default=20)
    arguments = parser.parse_args()
    for n in arguments.proposals:
        reference = sort_ms()
        known, unknown = (cost_ms(frames(n, arguments.frames, posed)) for posed in (True, False))
        line = {"proposals": n, "cpu_ms": known, "without_odometry_cpu_ms": unknown, "sort_cpu_ms": reference}
        print(json.dumps({k: round(v, 3) for k, v in line.items()}), flush=True)


if __name__ == "__main__":
    main()
