"""Obstacles that are kept, detected and recalled, on simulated drives with the truth of every point.

    python -m tools.study.obstacles [--scenes wall carpark ...] [--sensors vlp-16 ...] [--height M] [--seeds 900:904]
                                    [--seconds 4] [--mode accurate] [--jobs N]
    python -m tools.study.obstacles --scenes postures wall --seconds 1.2 --seeds 900:940

The first table has the shares [%] of the points of actors (people, vehicles, animals), of those within 3 m and of
the ground that are obstacles, and the false reports a frame: tracks with a class on ground or scenery.

The second has a row for each role of an actor in a scene. An actor is *detected* if one proposal holds more than half
of its points above the clearance, and more than half of that proposal is the actor; *recalled* if the reported class
is right as well; *or possible* if it is reported as a possible person instead (unknown, near). *Ids* is the number of
tracks that an actor has while it is detected.

The first half second, in which tracks begin, does not count. Actors count within 15 m with 20 points or more above
the clearance. Small ones, with no side of half a metre, count within 4 m with 5 points or more.
In brackets: 95 % intervals over the drives (bootstrap).

The simulated worlds of training share the makers of people and things with these scenes. Their seeds are 100,000 and
more; a figure from a smaller seed is from a world that no network has seen.
"""

from __future__ import annotations

from argparse import Namespace
from collections import defaultdict
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from functools import partial
from itertools import product

import numpy as np
from numpy.typing import ArrayLike

from modt.class_sizes import unknown_near
from modt.classes import CLASS_NAMES, N_CLASSES, OBJECTS
from modt.cli.progress import bar
from modt.config import ProfileConfig
from modt.sensor_fit.recognition import recognise
from modt.types import NONE, Frame, FrameResult, Int
from modt_evaluation.engine import Engine
from modt_simulation.simulator import Truth
from modt_simulation.synthetic_stream import SyntheticStream
from modt_simulation.world import World
from tools.options import parser
from tools.study.drives import add_options, steps_of
from tools.study.mounts import of_mount

PLACES = (
    *("postures", "hidden", "platform", "overhangs", "wall", "carpark", "grass", "hedges", "vines", "scooters"),
    *("hills", "heaps", "stairs", "movers", "clutter"),
)
SMALL_M = 0.5
"""Greatest side of a small actor."""
LEAST_POINTS = {False: 20, True: 5}
"""Points above the clearance from which an actor counts, by whether it is small."""
REACH_M = {False: 15.0, True: 4.0}
"""Distance within which it counts."""
NEAR_M = 3.0
MEASURED = ("actors kept", f"within {NEAR_M:g} m", "ground kept")
"""Points of which the share is measured that are obstacles."""
UNCOUNTED = 5
"""First frames, in which tracks begin."""
RESAMPLES = 1000


@dataclass(slots=True)
class Role:
    """Counts of the actors of one role in a drive."""

    seen: int = 0  # actors in all frames
    detected: int = 0
    recalled: int = 0
    possible: int = 0  # recalled, or detected and said to be possibly a person
    tracks: set[tuple[int, int]] = field(default_factory=set)  # body and track of those detected


@dataclass
class Drive:
    """Counts of a drive."""

    world: World
    profile: ProfileConfig
    frames: int = 0
    points: Int = field(default_factory=lambda: np.zeros((3, 2), np.int64))  # rows of MEASURED; obstacles, all
    false: Int = field(default_factory=lambda: np.zeros(N_CLASSES, np.int64))  # reports on no actor, by class
    roles: defaultdict[str, Role] = field(default_factory=lambda: defaultdict(Role))

    def add(self, frame: Frame, truth: Truth, result: FrameResult) -> None:
        """Count a frame."""
        self.frames += 1
        self._add_points(truth, result)
        label = result.proposals.label(len(frame.points))
        shared = self._shared(label, truth.instance, len(result.proposals))
        track_of = result.tracks.row_of_proposal(len(shared))
        reported = result.tracks.object_class[track_of]
        possible = unknown_near(result)[track_of]
        on_actor = np.isin(shared.argmax(axis=1) - 1, truth.bodies)
        self.false += np.bincount(reported[~on_actor], minlength=N_CLASSES)
        for body, kind in zip(truth.bodies.tolist(), truth.kinds, strict=True):
            above = self._above_clearance(frame, truth.instance, body)
            if not len(above):
                continue
            role = self.roles[self.world.bodies[body].role or kind.name]
            role.seen += 1
            best = np.bincount(label[above] + 1, minlength=2)[1:].argmax()
            of_actor = np.count_nonzero(label[above] == best)
            if 2 * of_actor > len(above) and 2 * shared[best, body + 1] > shared[best].sum():
                role.detected += 1
                recalled = bool(reported[best] == kind.object_class)
                role.recalled += recalled
                role.possible += recalled or bool(possible[best])
                role.tracks.add((body, int(result.tracks.id[track_of[best]])))

    def _add_points(self, truth: Truth, result: FrameResult) -> None:
        points = result.frame.points
        range_m = np.linalg.norm(points[:, :3], axis=1)
        obstacle = np.zeros(len(points), np.bool_)
        obstacle[result.obstacles()] = True
        in_range = (range_m > self.profile.sensor.min_range_m) & (range_m < self.profile.sensor.max_range_m)
        actor = np.isin(truth.instance, truth.bodies)
        for row, own in enumerate((actor, actor & (range_m < NEAR_M), truth.instance == NONE)):
            self.points[row] += np.count_nonzero(own & in_range & obstacle), np.count_nonzero(own & in_range)

    def _shared(self, label: Int, instance: Int, n_proposals: int) -> Int:
        """(P, bodies + 1) points of each proposal by what they lie on: the ground, then the bodies."""
        columns = len(self.world.bodies) + 1
        member = label != NONE
        cell = label[member] * columns + instance[member] + 1
        return np.bincount(cell, minlength=n_proposals * columns).reshape(n_proposals, columns)

    def _above_clearance(self, frame: Frame, instance: Int, body: int) -> Int:
        """Points of an actor above the clearance, or above a quarter of its height; none if it does not count."""
        size = self.world.bodies[body].size
        x, y, ground, *_ = self.world.poses(frame.stamp_s)[body]
        T_world_sensor = self.world.ego_pose(frame.stamp_s)
        rows = np.flatnonzero(instance == body)
        z = frame.points[rows, :3] @ T_world_sensor[2, :3] + T_world_sensor[2, 3]
        above = rows[z > ground + min(self.profile.segmentation.clearance_m, size[2] / 4)]
        small = max(size) < SMALL_M
        far = np.hypot(x - T_world_sensor[0, 3], y - T_world_sensor[1, 3]) > REACH_M[small]
        return above[:0] if far or len(above) < LEAST_POINTS[small] else above


def run(stream: SyntheticStream, mode_name: str) -> Drive:
    """Run a mode on a drive and count."""
    world = stream.simulator.world
    profile = of_mount(stream.simulator.sensor.name, world.height_m)
    first, _ = stream.simulator.sweep(0)
    profile = recognise(first.points, profile).mounted(profile)
    step = steps_of(mode_name, profile)
    drive = Drive(world, profile)
    for frame, truth in stream.sweeps():
        result = step(frame)
        if frame.index >= UNCOUNTED:
            drive.add(frame, truth, result)
    return drive


def _run(args: Namespace, drive: tuple[str, str, int]) -> Drive:
    """Run a drive by its scene, sensor and seed."""
    scene, sensor, seed = drive
    return run(SyntheticStream(scene, sensor, args.seconds, seed, height_m=args.height), args.mode)


def ratio(counts: ArrayLike, scale: float = 100.0) -> str:
    """Ratio of the sums of two columns (drives, 2), and its interval."""
    table = np.asarray(counts, np.float64).reshape(-1, 2)
    if not table[:, 1].sum():
        return "-"
    draw = np.random.default_rng(0).integers(len(table), size=(RESAMPLES, len(table)))
    sums = np.vstack([table.sum(axis=0), table[draw].sum(axis=1)])
    some = sums[sums[:, 1] > 0]
    value, *resampled = (scale * some[:, 0] / some[:, 1]).tolist()
    low, high = np.quantile(resampled, [0.025, 0.975])
    return f"{value:.3g} [{low:.3g}, {high:.3g}]"


def row_of_place(drives: Sequence[Drive]) -> list[str]:
    """Shares of points that are obstacles, and false reports a frame by class."""
    shares = [ratio([drive.points[row] for drive in drives]) for row in range(len(MEASURED))]
    return shares + [ratio([(drive.false[kind], drive.frames) for drive in drives], 1.0) for kind in OBJECTS]


def rows_of_roles(drives: Sequence[Drive]) -> Iterator[list[str]]:
    """Role, actors in all frames, shares detected, recalled and recalled or possible, and tracks an actor."""
    for name in sorted({name for drive in drives for name in drive.roles}):
        roles = [drive.roles[name] for drive in drives]
        yield [
            name,
            str(sum(role.seen for role in roles)),
            ratio([(role.detected, role.seen) for role in roles]),
            ratio([(role.recalled, role.seen) for role in roles]),
            ratio([(role.possible, role.seen) for role in roles]),
            ratio([(len(role.tracks), len({body for body, _ in role.tracks})) for role in roles], 1.0),
        ]


def _table(columns: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    lines = [columns, ["---"] * len(columns), *rows]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


def main() -> None:
    options = parser(__doc__)
    add_options(options, PLACES, (900, 904))
    options.add_argument("--height", type=float, metavar="M", help="of the sensor (default: its usual one)")
    options.add_argument("--jobs", type=int, default=1, metavar="N", help="number of processes (default: 1)")
    args = options.parse_args()
    seeds = range(*args.seeds)
    tasks = list(product(args.scenes, args.sensors, seeds))
    drive_of = {}
    with Engine(args.jobs) as engine, bar(len(tasks), "drive", shown=True) as tick:
        for task, drive in engine.results(partial(_run, args), tasks):
            drive_of[task] = drive
            tick(task[0])
    places = []
    roles = []
    for scene, sensor in product(args.scenes, args.sensors):
        drives = [drive_of[scene, sensor, seed] for seed in seeds]
        places.append([scene, sensor, *row_of_place(drives)])
        roles += [[scene, sensor, *row] for row in rows_of_roles(drives)]
    false = [f"false {CLASS_NAMES[kind]}s a frame" for kind in OBJECTS]
    print(_table(["scene", "sensor", *MEASURED, *false], places), end="\n\n")
    print(_table(["scene", "sensor", "role", "n", "detected", "recalled", "or possible", "ids"], roles))


if __name__ == "__main__":
    main()
