"""Recall of the segmentation by sensor, on labelled scans, thinned ones and simulated sweeps.

    python -m tools.study.segmentation_recall [--kitti ROOT] [--seeds 500:505] [--sensors NAME ...]

An object of 20 points or more is detected if it shares more than half of all points with one proposal.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from modt.classes import CLASS_NAMES, N_CLASSES
from modt.cli.options import frames as number_range
from modt.segmentation.segmenter import Segmenter
from modt.types import Int
from modt_simulation.sensors import SENSORS
from modt_training.scan import Scan
from modt_training.simulated import simulated_scans
from tools.options import parser
from tools.train.build_crops import kitti
from tools.train.labelled_scans import THINNED, argoverse_scans, pandaset_scans, thinned

MIN_POINTS = 20
SCENES = ("street", "crossing", "yard")
TIMES_S = (0.0, 2.0)


@dataclass
class Tally:
    """Objects of a sensor by class, and proposals.

    Attributes:
        objects, detected: (4,) numbers by class.
        proposals: number in all scans.
        scans: number of scans.
    """

    objects: Int = field(default_factory=lambda: np.zeros(N_CLASSES, np.int64))
    detected: Int = field(default_factory=lambda: np.zeros(N_CLASSES, np.int64))
    proposals: int = 0
    scans: int = 0

    def add(self, scan: Scan) -> None:
        """Segment a scan and count."""
        config = scan.profile
        proposals = Segmenter(config.segmentation, config.sensor, scan.fov).segment(scan.points)
        label = proposals.label(len(scan.points))
        self.proposals += len(proposals)
        self.scans += 1
        for kind, members in zip(scan.kinds, scan.objects, strict=True):
            if len(members) < MIN_POINTS or not (scan.fov.depth(scan.points[members]) > 0).mean() > 0.5:
                continue
            shared = np.bincount(label[members] + 1, minlength=len(proposals) + 1)[1:]
            union = proposals.count + len(members) - shared
            self.objects[kind] += 1
            self.detected[kind] += bool(len(union)) and (shared / union).max() > 0.5

    def row(self, name: str) -> str:
        """Row of a Markdown table: share of the objects detected by class, and proposals a scan."""
        cells = [f"{100 * f / n:.1f} of {n}" if n else "-" for f, n in zip(self.detected, self.objects, strict=True)]
        return f"| {name} | {' | '.join(cells[1:])} | {self.proposals / self.scans:.0f} |"


def labelled(root: Path) -> Iterator[Scan]:
    """Real scans of every sensor."""
    for scan in kitti(root):
        yield scan
        for step in THINNED:
            yield thinned(scan, step)
    yield from argoverse_scans(root / "argoverse2")
    yield from pandaset_scans(root / "pandaset")


def main() -> None:
    options = parser(__doc__)
    options.add_argument("--kitti", type=Path, metavar="ROOT")
    options.add_argument("--seeds", type=number_range, default=(500, 505), metavar="A:B")
    options.add_argument("--sensors", nargs="*", choices=SENSORS, default=list(SENSORS), metavar="NAME")
    args = options.parse_args()
    tallies: dict[str, Tally] = defaultdict(Tally)
    for scan in labelled(args.kitti) if args.kitti else ():
        tallies[scan.sensor].add(scan)
    for sensor in args.sensors:
        scans = simulated_scans(SCENES, range(*args.seeds), TIMES_S, camera=False, sensors=[sensor])
        for scan in scans:
            tallies[f"{sensor}, simulated"].add(scan)
    print("| sensor |", " | ".join(CLASS_NAMES[1:]), "| proposals a scan |\n|---|---|---|---|---|")
    for name, tally in tallies.items():
        print(tally.row(name))
    shares = [tally.detected / np.where(tally.objects, tally.objects, np.nan) for tally in tallies.values()]
    print("| mean |", " | ".join(f"{100 * v:.1f}" for v in np.nanmean(shares, axis=0)[1:]), "| |")


if __name__ == "__main__":
    main()
