"""CPU time of the tracker against the number of proposals, on static scenery seen from a sensor that drives.

With odometry, without, of the registration alone, and the frames a second that `modt track` follows.

A machine that is busy or slow is so for everything: each figure is also given relative to a sort of 100,000 numbers,
timed in the same run.
"""

from __future__ import annotations

import argparse
import json
import time
from dataclasses import replace
from pathlib import Path

import numpy as np

from modt.cli import track
from modt.config import TrackingConfig
from modt.geometry import inverse, se3, transform_boxes
from modt.observations import observe
from modt.odometry.registration import Registration
from modt.sources.detections import TYPES, Detections, files, read
from modt.tracking.states import EFFICIENT
from modt.tracking.tracker import Tracker
from modt.types import Frame, Proposals

POINTS = 80
"""Points of a proposal."""
WARM = 10
"""Frames left out: until then the tracks alive become more."""
OFF_M = np.array([0.05, 0.03, 0.0])
"""How far the prediction of the pose is off."""


def scenery(n: int, rng: np.random.Generator) -> np.ndarray:
    """(n, 7) boxes, as dense as proposals lie in a street."""
    half = 4.0 * np.sqrt(n)
    size = rng.uniform(0.3, 3.0, (n, 3))
    size[:, :2] = np.sort(size[:, :2], axis=1)[:, ::-1]
    return np.c_[rng.uniform(-half, half, (n, 2)), np.full(n, -1.0), size, rng.uniform(-3, 3, n)]


def frames(n: int, count: int, alive: float, seed: int = 0) -> list[tuple[Frame, Proposals]]:
    """Frames that each show n of the scenery's alive * n boxes, those seen by points strewn over them.

    What is hidden comes back before its track ends, as behind poles and cars; so the tracks are that many more.
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
        flags = np.zeros(n, np.bool_)
        members, offsets, coordinates = np.arange(n * POINTS), np.arange(n + 1) * POINTS, points[:, :3].T.copy()
        proposals = Proposals(members, offsets, coordinates, xyz.mean(axis=1), boxes, flags)
        out.append((Frame(i, 0.1 * i, points, T), proposals))
    return out


def median_ms(times_ns: list[int]) -> float:
    """Median of the frames after the first ones [ms]."""
    return float(np.median(times_ns[WARM:])) / 1e6


def tracking_ms(scene: list[tuple[Frame, Proposals]]) -> tuple[float, float]:
    """CPU time of a frame [ms], and the tracks alive."""
    tracker = Tracker(TrackingConfig(), EFFICIENT)
    times, alive = [], []
    for frame, proposals in scene:
        began = time.thread_time_ns()
        tracker.follow(frame, proposals)
        times.append(time.thread_time_ns() - began)
        alive.append(len(tracker.tracks))
        classify(tracker)
    return median_ms(times), float(np.mean(alive[WARM:]))


def registration_ms(scene: list[tuple[Frame, Proposals]]) -> float:
    """CPU time of the registration of a frame to tracks that were placed by odometry [ms]."""
    tracker, registration = Tracker(TrackingConfig(), EFFICIENT), Registration()
    times = []
    for frame, proposals in scene:
        observations = observe(proposals, se3(np.eye(3), frame.T_world_sensor[:3, 3] + OFF_M))
        began = time.thread_time_ns()
        registration.correct(tracker.tracks, observations)
        times.append(time.thread_time_ns() - began)
        tracker.follow(frame, proposals)
        classify(tracker)
    return median_ms(times)


def classify(tracker: Tracker) -> None:
    """Settle whatever asks: it is background."""
    rows = np.flatnonzero(tracker.asking())
    tracker.tracks.posterior[rows], tracker.tracks.final[rows] = [1, 0, 0, 0], True
    tracker.settle(rows, np.ones(len(rows), np.bool_))


def traffic(cars: int, count: int, seed: int = 0) -> Detections:
    """Detections of cars that come and go in lanes, a tenth of them missed, a fifth weak."""
    rng = np.random.default_rng(seed)
    frame, car = (a.ravel() for a in np.meshgrid(np.arange(count), np.arange(cars), indexing="ij"))
    x = 5 + (car * 60 / cars + 0.8 * frame) % 60
    box = np.zeros((len(frame), 7))
    box[:, :3] = np.stack([x, 3.5 * (car % 4 - 1.5), np.full(len(x), -1.0)], axis=1) + rng.normal(0, 0.1, (len(x), 3))
    box[:, 3:6] = [4.2, 1.8, 1.5]
    seen = rng.random(len(frame)) < 0.9
    score = np.where(rng.random(len(frame)) < 0.2, -1.0, 5.0)
    type_ = np.full(len(frame), TYPES.index("Car"))
    return Detections("traffic", frame, type_, np.zeros((len(frame), 4)), score, box).take(seen)


def box_frames_per_s(sequences: list[Detections]) -> float:
    """Frames a second of CPU time that `modt track` follows."""
    began = time.process_time()
    for sequence in sequences:
        track.follow(sequence, None, 0.1)
    return sum(s.n_frames for s in sequences) / (time.process_time() - began)


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
    parser.add_argument("--alive", type=float, default=1.7, help="tracks for each proposal (default: %(default)g)")
    parser.add_argument("--frames", type=int, default=40)
    parser.add_argument("--detections", type=Path, help="what `modt track` is given (default: 8 cars in lanes)")
    arguments = parser.parse_args()
    for n in arguments.proposals:
        scene = frames(n, arguments.frames, arguments.alive)
        known, alive = tracking_ms(scene)
        line = {
            "proposals": n,
            "tracks": alive,
            "cpu_ms": known,
            "without_odometry_cpu_ms": tracking_ms([(replace(f, T_world_sensor=None), p) for f, p in scene])[0],
            "registration_cpu_ms": registration_ms(scene),
            "sort_cpu_ms": sort_ms(),
        }
        print(json.dumps({k: round(v, 3) for k, v in line.items()}), flush=True)
    given = arguments.detections
    rate = box_frames_per_s(read(files(given)) if given else [traffic(8, 500)])
    print(json.dumps({"box_frames_per_s": round(rate), "sort_cpu_ms": round(sort_ms(), 3)}))


if __name__ == "__main__":
    main()
