"""CPU time of the tracker by number of proposals, on a static scene and a moving sensor.

Printed with poses and without, where odometry estimates them, and as frames per second of `modt track`. The reference
workload, sorting 100,000 numbers, relates figures of different machines.
"""

from __future__ import annotations

import json
import time
from dataclasses import replace
from pathlib import Path

import numpy as np

from modt.classes import ObjectClass
from modt.config import TrackingConfig
from modt.geometry import inverse, se3, transform_boxes
from modt.odometry.odometry import Odometry
from modt.tracking.states import EFFICIENT
from modt.tracking.tracker import Tracker
from modt.types import Float64, Frame, Proposals
from modt_desk.box_tracking.detections import Detections, files, read
from modt_desk.box_tracking.sequences import follow
from tools.options import parser

POINTS = 80
"""Points of a proposal."""
WARM_UP_FRAMES = 10
"""Frames left out of the figures, while the number of tracks grows."""


def scenery(n: int, rng: np.random.Generator) -> Float64:
    """(n, 7) boxes, with the density of proposals in a street."""
    half = 4.0 * np.sqrt(n)
    size = rng.uniform(0.3, 3.0, (n, 3))
    size[:, :2] = np.sort(size[:, :2], axis=1)[:, ::-1]
    return np.c_[rng.uniform(-half, half, (n, 2)), np.full(n, -1.0), size, rng.uniform(-3, 3, n)]


def frames(n: int, count: int, alive: float, seed: int = 0) -> list[tuple[Frame, Proposals]]:
    """Frames with random points on n of the alive * n boxes of a scene, chosen anew for each frame.

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


def traffic(cars: int, count: int, seed: int = 0) -> Detections:
    """Detections of cars in lanes, 10 % missed, 20 % with a low score."""
    rng = np.random.default_rng(seed)
    frame, car = (a.ravel() for a in np.meshgrid(np.arange(count), np.arange(cars), indexing="ij"))
    x = 5 + (car * 60 / cars + 0.8 * frame) % 60
    box = np.zeros((len(frame), 7))
    box[:, :3] = np.stack([x, 3.5 * (car % 4 - 1.5), np.full(len(x), -1.0)], axis=1) + rng.normal(0, 0.1, (len(x), 3))
    box[:, 3:6] = [4.2, 1.8, 1.5]
    detected = rng.random(len(frame)) < 0.9
    score = np.where(rng.random(len(frame)) < 0.2, -1.0, 5.0)
    object_class = np.full(len(frame), ObjectClass.CAR)
    return Detections("traffic", frame, object_class, np.zeros((len(frame), 4)), score, box).take(detected)


def box_frames_per_s(sequences: list[Detections]) -> float:
    """Frames of `modt track` per second of CPU time."""
    began = time.process_time()
    for sequence in sequences:
        follow(sequence, None, 0.1)
    return sum(s.n_frames for s in sequences) / (time.process_time() - began)


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
    options.add_argument("--detections", type=Path, help="input of `modt track` (default: 8 cars in lanes)")
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
    given = arguments.detections
    rate = box_frames_per_s(read(files(given)) if given else [traffic(8, 500)])
    print(json.dumps({"box_frames_per_s": round(rate), "sort_cpu_ms": round(sort_ms(), 3)}))


if __name__ == "__main__":
    main()
