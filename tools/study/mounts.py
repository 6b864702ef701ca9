"""Recall and precision of people by the mount of the sensor and by place, on simulated drives with exact truth.

    python -m tools.study.mounts [--sensors vlp-16 ...] [--scenes yard corridor ...] [--heights 0.3 0.8 ...]
                                 [--mounts 0,0 0,10 ...] [--seeds 700:702] [--seconds 4] [--mode accurate]

A row is a sensor in a scene, at a height [m] and with a roll and a pitch [deg], over the seeds; its profile states
the height. A cell has the number of objects of 20 points or more, the shares of them that are detected (point IoU
over 1/2) and detected with the right class, and the precision of that class [%]. There are cells of people by
distance [m], of all people and of cars.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import product

import numpy as np

from modt.classes import ObjectClass
from modt.config import ProfileConfig
from modt.profile import load
from modt.sensor_fit.recognition import recognise
from modt_evaluation.evaluation import DriveRows
from modt_evaluation.rows import Outcome
from modt_evaluation.truth import Role
from tools.options import parser
from tools.study.drives import Drive, add_options, judged, simulated

BANDS_M = ((0.5, 3.0), (3.0, 8.0), (8.0, 20.0), (20.0, 60.0))
EVERYWHERE_M = (0.0, float("inf"))
HEIGHTS_M = (0.2, 0.3, 0.5, 0.8, 1.7)
MOUNTS_DEG = ((0.0, 0.0), (0.0, 10.0), (0.0, 15.0), (10.0, 0.0), (15.0, 0.0), (180.0, 0.0))
"""Roll and pitch."""
PLACES = ("yard", "corridor", "hall", "crowd", "ramp")


def run(drive: Drive, mode_name: str, config: ProfileConfig) -> DriveRows:
    """Run a drive in a mode, with the tilt that its first sweep shows, and judge it."""
    first, _ = drive.frames[0]
    return judged(replace(drive, profile=recognise(first.points, config).mounted(config)), mode_name)


def of_mount(sensor: str, height_m: float) -> ProfileConfig:
    """The sensor's profile with the height of its mount."""
    config = load(sensor)
    return replace(config, sensor=replace(config.sensor, height_m=height_m))


def shares(drives: Sequence[DriveRows], kind: ObjectClass, band_m: tuple[float, float]) -> str:
    """Objects of a class within a band of range: their number, shares detected and recalled, and precision."""
    objects, proposals = (
        rows[(rows["range_m"] >= band_m[0]) & (rows["range_m"] < band_m[1])]
        for rows in (np.concatenate([d.objects for d in drives]), np.concatenate([d.proposals for d in drives]))
    )
    wanted = objects[(objects["class"] == kind) & (objects["role"] == Role.COUNTED) & objects["to_segment"]]
    reported = proposals[proposals["to_report"] & (proposals["reported"] == kind)]
    of_class = (wanted["outcome"] == Outcome.DETECTED, wanted["reported"] == kind, reported["box_class"] == kind)
    percent = (f"{100 * np.mean(of):.0f}" if len(of) else "-" for of in of_class)
    return f"{len(wanted)}: {' / '.join(percent)}"


def row(of: str, drives: Sequence[DriveRows]) -> str:
    """Markdown."""
    people = [shares(drives, ObjectClass.PEDESTRIAN, band) for band in (*BANDS_M, EVERYWHERE_M)]
    return f"| {of} | {' | '.join(people)} | {shares(drives, ObjectClass.CAR, EVERYWHERE_M)} |"


def _angles(text: str) -> tuple[float, float]:
    roll, pitch = text.split(",")
    return float(roll), float(pitch)


def main() -> None:
    options = parser(__doc__)
    add_options(options, PLACES, (700, 702))
    options.add_argument("--heights", nargs="+", type=float, default=HEIGHTS_M, metavar="M")
    options.add_argument("--mounts", nargs="+", type=_angles, default=MOUNTS_DEG, metavar="ROLL,PITCH")
    args = options.parse_args()
    bands = [f"people {low:g}-{high:g}" for low, high in BANDS_M]
    columns = ["sensor", "scene", "height", "roll, pitch", *bands, "people", "cars"]
    print(f"| {' | '.join(columns)} |\n|{'---|' * len(columns)}")
    for sensor, scene, height_m, angles in product(args.sensors, args.scenes, args.heights, args.mounts):
        drives = []
        for seed in range(*args.seeds):
            drive = simulated(scene, sensor, args.seconds, seed, height_m=height_m, mount_deg=angles)
            drives.append(run(drive, args.mode, of_mount(sensor, height_m)))
        print(row(f"{sensor} | {scene} | {height_m:g} | {angles[0]:g}, {angles[1]:g}", drives), flush=True)


if __name__ == "__main__":
    main()
