"""CPU time of odometry and tracking by number of proposals, on a static scene and a moving sensor.

    python -m tools.bench.tracking [--proposals N ...] [--alive 1.7] [--frames 40]

A line has the times with poses and without, where odometry estimates them. The time that sorting 100,000 numbers
takes relates figures of different machines.
"""

from __future__ import annotations

import json
import time
from dataclasses import replace

import numpy as np

from modt.config import TrackingConfig
from modt.geometry import inverse, se3, transform_boxes
from modt.odometry.odometry import Odometry
from modt.tracking.states import EFFICIENT
from modt.tracking.tracker import Tracker
from modt.types import Float64, Frame, Proposals
from tools.options import parser

POINTS = 80
"""Number of points of a proposal."""
WARM_UP_FRAMES = 10
"""Frames left out while the number of tracks grows."""


def scenery(n: int, rng: np.random.Generator) -> Float64:
    """(n, 7) boxes, with the density of proposals in a street."""
    half = 4.0 * np.sqrt(n)
    size = rng.uniform(0.3, 3.0, (n, 3))
    size[:, :2] = np.sort(size[:, :2], axis=1)[:, ::-1]
    return np.c_[rng.uniform(-half, half, (n, 2)), np.full(n, -1.0), size, rng.uniform(-3, 3, n)]


def frames(n: int, count: int, alive: float, seed: int = 0) -> list[tuple[Frame, Proposals]]:
    """Frames with random points on n of the alive * n boxes of a scene; each frame has its own choice of boxes.

    A box reappears before its track is deleted, so about alive * n tracks are alive.
    """
    rng = np.random.default_rng(seed)
    world, out = scenery(round(alive * n), rng), []
    for i in range(count):
        T = se3(np.eye(3), np.array([0.8 * i, 0.0, 0.0]))
        boxes = transform_boxes(inverse(T), world[np.sort(rng.permutation(len(world))[:n])])
        local = rng.uniform(-0.5, 0.5, (n, POINTS, 3)) * boxes[:, None, 3:6]
        c, s = np.cos(boxes[:, 6])[:, None], np.sin(boxes[:, 6])[:, None]
        x, y = c * local[..., 0] - s * local[..., 1], s * local[..., 0] + c * local[..., 1]
        xyz = np.stack([x, y, local[..., 2]], axis=-1) + boxes[:, None, :3]
        points = np.concatenate([xyz.reshape(-1, 3), np.zeros((n * POINTS, 1))], axis=1).astype(np.float32)
        flags = np.zeros(n, np.int64)
        members, offsets, coordinates = np.arange(n * POINTS), np.arange(n + 1) * POINTS, points[:, :3].T.copy()
        proposals = Proposals(members, offsets, coordinates, xyz.mean(axis=1), boxes, flags)
        out.append((Frame(i, 0.1 * i, points, T), proposals))
    return out


def stages_ms(scene: list[tuple[Frame, Proposals]]) -> tuple[float, float, float]:
    """Median CPU time per frame of odometry and of tracking [ms], and mean number of tracks."""
    odometry, tracker = Odometry(), Tracker(TrackingConfig(), EFFICIENT)
    times_ns, alive = [], []
    for frame, proposals in scene:
        began_ns = time.thread_time_ns()
        located = odometry.locate(frame, proposals, tracker.static_tracks)
        located_ns = time.thread_time_ns()
        tracked = tracker.follow(frame.stamp_s, proposals, located)
        rows = np.flatnonzero(tracked.wants_class)
        tracked.tracks.posterior[rows] = [1, 0, 0, 0]
        tracker.conclude(rows, np.ones(len(rows), np.bool_))
        times_ns.append((located_ns - began_ns, time.thread_time_ns() - located_ns))
        alive.append(len(tracked.tracks))
    odometry_ms, tracking_ms = np.median(times_ns[WARM_UP_FRAMES:], axis=0) / 1e6
    return float(odometry_ms), float(tracking_ms), float(np.mean(alive[WARM_UP_FRAMES:]))


def sort_ms() -> float:
    """Median CPU time of the reference workload [ms]."""
    numbers, times = np.random.default_rng(0).random(100_000), []
    for _ in range(21):
        began = time.thread_time_ns()
        np.sort(numbers)
        times.append((time.thread_time_ns() - began) / 1e6)
    return float(np.median(times))


def main() -> None:
    options = parser(__doc__)
    options.add_argument("--proposals", type=int, nargs="+", default=[50, 100, 150, 250, 500, 1000])
    options.add_argument("--alive", type=float, default=1.7, help="tracks per proposal (default: %(default)g)")
    options.add_argument("--frames", type=int, default=40)
    arguments = options.parse_args()
    for n in arguments.proposals:
        scene = frames(n, arguments.frames, arguments.alive)
        _, with_poses_ms, alive = stages_ms(scene)
        odometry_ms, tracking_ms, _ = stages_ms([(replace(f, T_world_sensor=None), p) for f, p in scene])
        line = {
            "proposals": n,
            "tracks": alive,
            "tracking_cpu_ms": with_poses_ms,
            "without_poses_odometry_cpu_ms": odometry_ms,
            "without_poses_tracking_cpu_ms": tracking_ms,
            "sort_cpu_ms": sort_ms(),
        }
        print(json.dumps({k: round(v, 3) for k, v in line.items()}), flush=True)


if __name__ == "__main__":
    main()
