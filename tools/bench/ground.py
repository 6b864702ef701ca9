"""Ground and obstacles on SemanticKITTI's labels, beside a published ground filter, with the CPU time of both.

    python -m tools.bench.ground ROOT [--clearance M ...] [--rings M ...] [--repeat N]

ROOT is a KITTI folder with labelled scans in `odometry`. Precision and recall are those of Patchwork++'s own
benchmark: ground is road, parking, sidewalk, lane marking, other ground and terrain; unlabelled points and outliers
do not count. Vegetation does not count either ("without vegetation"), or counts as ground up to a quarter of the
sensor's height above its foot and as obstacle higher up ("with low vegetation"). For modt, a point up to the
clearance above the surface is ground. All points within the range of Patchwork++ count (extra "bench"; without it,
modt runs alone). Both run in one thread on the same scans in turn; a time is the median of the scans and repeats.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import TypeVar

import numpy as np

from modt import profile
from modt.app.assembly import chosen_kernels
from modt.config import NATIVE, SegmentationConfig
from modt.geometry import FieldOfView
from modt.segmentation.grids import PointColumns
from modt.segmentation.segmenter import Segmenter
from modt.types import Bool, Float32, Int
from tools.options import parser

UNLABELLED = (0, 1)
GROUND = (40, 44, 48, 49, 60, 72)
VEGETATION = 70
SENSOR_HEIGHT_M = 1.73
Filter = Callable[[Float32], None]
T = TypeVar("T")
RANGES_M = (2.7, 80.0)
"""Nearest and farthest range of Patchwork++'s defaults [m]."""


@dataclass(frozen=True)
class LabelledScan:
    """A scan with a class a point.

    Attributes:
        points: (N, 4) points.
        label: (N,) classes of SemanticKITTI.
    """

    points: Float32
    label: Int

    @classmethod
    def read(cls, label: Path) -> LabelledScan:
        """A scan by its file of labels."""
        scan = label.parents[1] / "velodyne" / f"{label.stem}.bin"
        points = np.fromfile(scan, np.float32).reshape(-1, 4)
        return cls(points, (np.fromfile(label, np.uint32) & 0xFFFF).astype(np.int64))

    def truth(self, *, vegetation: bool) -> tuple[Bool, Bool]:
        """(N,) points of the ground and (N,) points of obstacles; others do not count."""
        counted = ~np.isin(self.label, UNLABELLED)
        ground = np.isin(self.label, GROUND)
        if vegetation:
            ground |= (self.label == VEGETATION) & (self.points[:, 2] < -0.75 * SENSOR_HEIGHT_M)
        else:
            counted &= self.label != VEGETATION
        return ground, counted & ~ground


@dataclass(frozen=True)
class Score:
    """Precision, recall and F1 of one kind of points [%]."""

    precision: float
    recall: float

    @classmethod
    def of(cls, found: Bool, true: Bool, other: Bool) -> Score:
        """Score of the points found, given those of the kind and those of the other one."""
        hits = float((found & true).sum())
        return cls(100 * hits / max((found & (true | other)).sum(), 1), 100 * hits / max(true.sum(), 1))

    def cells(self) -> str:
        """Cells of a table: precision, recall and F1."""
        f1 = 2 * self.precision * self.recall / max(self.precision + self.recall, 1e-9)
        return f"{self.precision:.2f} | {self.recall:.2f} | {f1:.2f}"


class Modt:
    """Heights above the ground, and the time of the compiled filter."""

    def __init__(self) -> None:
        shipped = profile.load("hdl-64e")
        self.height_m = shipped.sensor.height_m or SENSOR_HEIGHT_M
        self.segmenter = Segmenter(shipped.segmentation, shipped.sensor, FieldOfView(), chosen_kernels(NATIVE))

    def height(self, points: Float32) -> Float32:
        """(N,) height of each point above the ground [m]; the compiled filter gives the same bytes."""
        return self.segmenter.ground.height_above(PointColumns.from_array(points), self.height_m)

    def run(self, points: Float32) -> None:
        """The points above the ground, by the compiled filter."""
        self.segmenter.above_ground(points)


class Patchwork:
    """Patchwork++ with its defaults."""

    def __init__(self) -> None:
        module = import_module("pypatchworkpp")
        parameters = module.Parameters()
        parameters.verbose = False
        self.filter = module.patchworkpp(parameters)

    def run(self, points: Float32) -> None:
        """Divide the points."""
        self.filter.estimateGround(points)

    def is_ground(self, points: Float32) -> Bool:
        """(N,) points of the ground."""
        self.run(points)
        ground = np.zeros(len(points), np.bool_)
        ground[np.asarray(self.filter.getGroundIndices(), np.int64)] = True
        return ground


def cpu_ms(work: Callable[[T], object], argument: T) -> float:
    """CPU time of a call [ms]."""
    start = time.thread_time_ns()
    work(argument)
    return (time.thread_time_ns() - start) / 1e6


def labelled_scans(root: Path) -> list[LabelledScan]:
    """The labelled scans of a KITTI folder."""
    return [LabelledScan.read(path) for path in sorted((root / "odometry").glob("*/labels/*.label"))]


def rows(found: dict[str, Bool], scans: list[LabelledScan], within_m: tuple[float, float]) -> Iterator[str]:
    """Rows of a table: precision, recall and F1 of ground and of obstacles, in both definitions."""
    range_m = np.concatenate([np.hypot(scan.points[:, 0], scan.points[:, 1]) for scan in scans])
    inside = (range_m > within_m[0]) & (range_m < within_m[1])
    for vegetation, definition in ((False, "without vegetation"), (True, "with low vegetation")):
        truths = [scan.truth(vegetation=vegetation) for scan in scans]
        ground, obstacle = (np.concatenate(parts) & inside for parts in zip(*truths, strict=True))
        for name, is_ground in found.items():
            scores = Score.of(is_ground, ground, obstacle), Score.of(~is_ground, obstacle, ground)
            yield f"| {definition} | {name} | {' | '.join(score.cells() for score in scores)} |"


def print_times(filters: dict[str, Filter], scans: list[LabelledScan], repeat: int) -> None:
    """Print the median CPU time of each filter."""
    print("| CPU time a scan | median |\n|---|---|")
    times: dict[str, list[float]] = {name: [] for name in filters}
    for _ in range(repeat):
        for scan in scans:
            for name, work in filters.items():
                times[name].append(cpu_ms(work, scan.points))
    for name, all_ms in times.items():
        print(f"| {name} | {np.median(all_ms):.2f} ms |")


def main() -> None:
    options = parser(__doc__)
    options.add_argument("root", type=Path)
    options.add_argument(
        "--clearance", type=float, nargs="+", default=[SegmentationConfig().clearance_m], metavar="M"
    )
    options.add_argument("--rings", type=float, nargs="+", default=list(RANGES_M), metavar="M")
    options.add_argument("--repeat", type=int, default=10, metavar="N")
    arguments = options.parse_args()
    scans = labelled_scans(arguments.root)
    modt = Modt()
    height = np.concatenate([modt.height(scan.points) for scan in scans])
    found = {f"modt, {clearance_m} m": height <= clearance_m for clearance_m in arguments.clearance}
    filters: dict[str, Filter] = {"modt": modt.run}
    if find_spec("pypatchworkpp"):
        patchwork = Patchwork()
        found["Patchwork++"] = np.concatenate([patchwork.is_ground(scan.points) for scan in scans])
        filters["Patchwork++"] = patchwork.run
    else:
        print('pypatchworkpp is not installed (extra "bench"): modt alone\n')
    kinds = "precision of ground | recall | F1 | precision of obstacles | recall | F1"
    for within_m in zip(arguments.rings, arguments.rings[1:], strict=False):
        print("{:g} to {:g} m\n".format(*within_m))
        print(f"| vegetation | filter | {kinds} |\n|{'---|' * 8}")
        print("\n".join(rows(found, scans, within_m)), end="\n\n")
    print_times(filters, scans, arguments.repeat)


if __name__ == "__main__":
    main()
