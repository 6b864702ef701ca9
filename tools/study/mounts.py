"""Recall of people by the mount of the sensor and by place, on simulated drives with exact truth.

    python -m tools.study.mounts [--sensors vlp-16 ...] [--scenes yard corridor ...] [--heights 0.3 0.8 ...]
                                 [--mounts 0,0 0,10 ...] [--seeds 700:702] [--seconds 4] [--mode accurate]
                                 [--levelled]

A row is a sensor in a scene, at a height [m] and with a roll and a pitch [deg], over the seeds; its profile states
the height. Printed are, for objects of 20 points or more, the shares detected (point IoU over 1/2) and detected with
the right class [%], for people by distance [m] and in all, and for cars, and the proposals longer than 1.5 m that
hold no object, a frame. --levelled
turns the sweeps level by the true angles first: the best that a fitted mount can reach.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import product

import numpy as np

from modt.app import assembly
from modt.classes import ObjectClass
from modt.cli.options import frames as number_range
from modt.config import ProfileConfig
from modt.geometry import FieldOfView, inverse, transform_boxes
from modt.placement import Mount
from modt.profile import load
from modt.sensor_fit.recognition import recognise
from modt.types import Frame, FrameResult
from modt_desk.evaluation.evaluation import DriveRows, collect
from modt_desk.evaluation.frame import JudgedFrame
from modt_desk.evaluation.rows import Outcome as Found
from modt_desk.evaluation.rows import Rows
from modt_desk.evaluation.rules import CUBOID_RULES
from modt_desk.evaluation.truth import FrameTruth, Role
from modt_desk.simulation.sensors import SENSORS
from modt_desk.simulation.simulator import Truth
from modt_desk.simulation.synthetic_stream import SCENES, SyntheticStream
from tools.options import parser
from tools.study.drives import TYPES

BANDS_M = ((0.5, 3.0), (3.0, 8.0), (8.0, 20.0), (20.0, 60.0))
LONG_M = 1.5
EVERYWHERE_M = (0.0, float("inf"))
HEIGHTS_M = (0.2, 0.3, 0.5, 0.8, 1.7)
MOUNTS_DEG = ((0.0, 0.0), (0.0, 10.0), (0.0, 15.0), (10.0, 0.0), (15.0, 0.0), (180.0, 0.0))
"""Roll and pitch."""
PLACES = ("yard", "corridor", "hall", "crowd", "ramp")


@dataclass(frozen=True, slots=True)
class Drive:
    """Frames of a mount and their truth."""

    stream: SyntheticStream
    mount: Mount
    frames: Sequence[tuple[Frame, Truth]]

    @classmethod
    def simulated(
        cls, scene: str, sensor: str, seconds: float, seed: int, height_m: float, angles_deg: tuple[float, float]
    ) -> Drive:
        """A drive through a scene with a sensor at a height, rolled and pitched."""
        stream = SyntheticStream(scene, sensor, seconds, seed, height_m=height_m, mount_deg=angles_deg)
        return cls(stream, Mount.of(*angles_deg), list(stream.sweeps()))

    def truth(self, frame: Frame, truth: Truth) -> FrameTruth:
        """Labels of a frame, boxes in the level frame."""
        pose = self.mount.level(frame).T_world_sensor
        assert pose is not None
        boxes = transform_boxes(inverse(pose), self.stream.simulator.world.boxes(frame.stamp_s)[truth.bodies])
        return FrameTruth.of(TYPES, truth.bodies.tolist(), [kind.name for kind in truth.kinds], boxes)


@dataclass(frozen=True, slots=True)
class Outcome:
    """Judged rows of a drive, and the number of long proposals without an object."""

    rows: DriveRows
    long: int


def run(drive: Drive, mode_name: str, config: ProfileConfig, *, levelled: bool = False) -> Outcome:
    """Run a drive in a mode and judge it."""
    mount, mode, longer = drive.mount, assembly.MODES[mode_name], 0
    given = [mount.level(frame) if levelled else frame for frame, _ in drive.frames]
    config = recognise(given[0].points, config).mounted(config)
    pipeline, budget = assembly.pipeline(mode, config, FieldOfView()), mode.budget(config)

    def judged() -> Iterator[JudgedFrame]:
        nonlocal longer
        for (frame, truth), sweep in zip(drive.frames, given, strict=True):
            result = pipeline.step(sweep, budget)
            longer += _long(result, truth)
            yield replace(JudgedFrame.of_result(result, drive.truth(frame, truth)), points=mount.turn(frame.points))

    return Outcome(collect(judged(), CUBOID_RULES), longer)


def _long(result: FrameResult, truth: Truth) -> int:
    """Proposals longer than LONG_M of which less than half the points lie on an object."""
    proposals = result.proposals
    if not len(proposals):
        return 0
    on = (truth.object_class[proposals.members] != ObjectClass.BACKGROUND).astype(np.float64)
    share = np.add.reduceat(on, proposals.offsets[:-1]) / proposals.count
    return int(((proposals.box[:, 3] > LONG_M) & (share < 0.5)).sum())


def of_mount(sensor: str, height_m: float) -> ProfileConfig:
    """The sensor's profile with the height of its mount."""
    config = load(sensor)
    return replace(config, sensor=replace(config.sensor, height_m=height_m))


def shares(objects: Rows, kind: ObjectClass, band_m: tuple[float, float]) -> str:
    """Number, share detected and share with the right class [%] of the objects of a class within a band of range."""
    wanted = objects[
        (objects["class"] == kind)
        & (objects["role"] == Role.COUNTED)
        & objects["to_segment"]
        & (objects["range_m"] >= band_m[0])
        & (objects["range_m"] < band_m[1])
    ]
    if not len(wanted):
        return "-"
    found, called = (100 * np.mean(of) for of in (wanted["outcome"] == Found.DETECTED, wanted["reported"] == kind))
    return f"{len(wanted)}: {found:.0f} / {called:.0f}"


def row(of: str, outcomes: Sequence[Outcome]) -> str:
    """Markdown."""
    objects = np.concatenate([outcome.rows.objects for outcome in outcomes])
    people = [shares(objects, ObjectClass.PEDESTRIAN, band) for band in (*BANDS_M, EVERYWHERE_M)]
    cars = shares(objects, ObjectClass.CAR, EVERYWHERE_M)
    longer = sum(outcome.long for outcome in outcomes) / sum(outcome.rows.frames for outcome in outcomes)
    return f"| {of} | {' | '.join(people)} | {cars} | {longer:.1f} |"


def _angles(text: str) -> tuple[float, float]:
    roll, pitch = text.split(",")
    return float(roll), float(pitch)


def main() -> None:
    options = parser(__doc__)
    options.add_argument("--sensors", nargs="+", choices=SENSORS, default=["vlp-16", "os1-64", "mid-360"])
    options.add_argument("--scenes", nargs="+", choices=SCENES, default=PLACES)
    options.add_argument("--heights", nargs="+", type=float, default=HEIGHTS_M, metavar="M")
    options.add_argument("--mounts", nargs="+", type=_angles, default=MOUNTS_DEG, metavar="ROLL,PITCH")
    options.add_argument("--seeds", type=number_range, default=(700, 702), metavar="A:B")
    options.add_argument("--seconds", type=float, default=4.0)
    options.add_argument("--mode", choices=assembly.MODES, default="accurate")
    options.add_argument("--levelled", action="store_true", help="turn the sweeps level by the true angles first")
    args = options.parse_args()
    bands = [f"people {low:g}-{high:g}" for low, high in BANDS_M]
    columns = ["sensor", "scene", "height", "roll, pitch", *bands, "people", "cars", "long"]
    print(f"| {' | '.join(columns)} |\n|{'---|' * len(columns)}")
    for sensor, scene, height_m, angles in product(args.sensors, args.scenes, args.heights, args.mounts):
        drives = (Drive.simulated(scene, sensor, args.seconds, seed, height_m, angles) for seed in range(*args.seeds))
        config = of_mount(sensor, height_m)
        outcomes = [run(drive, args.mode, config, levelled=args.levelled) for drive in drives]
        print(row(f"{sensor} | {scene} | {height_m:g} | {angles[0]:g}, {angles[1]:g}", outcomes), flush=True)


if __name__ == "__main__":
    main()
