"""Compare simulated sweeps with real ones: points, proposals, sizes and recall.

    python -m tools.study.compare_synthetic KITTI_ROOT [--scene NAME ...] [--worlds N] [--sweeps N] [--real N]

The real sweeps are the full scans of the object benchmark, the simulated ones a few of several worlds. Both are
segmented in the camera's view, and counted, alike.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Iterator
from itertools import islice, pairwise
from pathlib import Path

import numpy as np

from modt import profile
from modt.classes import CLASS_NAMES
from modt.segmentation.segmenter import Segmenter
from modt.types import Proposals
from modt_desk.evaluation.overlap import FOOT_M
from tools.options import parser
from tools.train.labelled_scans import Scan, object_scans
from tools.train.synthetic_scans import simulated_scans

RINGS_M = (5, 10, 15, 20, 30, 50)
LOW_Z_M = -1.3
"""Points below this height in the sensor frame lie near the ground."""
MIN_POINTS = 20


def figures(scans: Iterable[Scan]) -> dict[str, str]:
    """Statistics of a set of scans, as text."""
    config = profile.load()
    sums: dict[str, list[float]] = defaultdict(list)
    hits: dict[str, list[bool]] = defaultdict(list)
    for scan in scans:
        rho, z = np.hypot(scan.points[:, 0], scan.points[:, 1]), scan.points[:, 2]
        sums["points a sweep"].append(len(scan.points))
        for near, far in pairwise(RINGS_M):
            ring = (rho >= near) & (rho < far)
            sums[f"points {near}-{far} m, below {LOW_Z_M} m"].append(float((ring & (z < LOW_Z_M)).sum()))
            sums[f"points {near}-{far} m, above"].append(float((ring & (z > LOW_Z_M)).sum()))
        sums["reflectance, median"].append(float(np.median(scan.points[:, 3])))
        proposals = Segmenter(config.segmentation, config.sensor, scan.fov).segment(scan.points)
        sums["proposals"].append(len(proposals))
        for name, column in (("length", 3), ("width", 4), ("height", 5)):
            sums[f"{name} of a proposal, median [m]"].extend(proposals.box[:, column])
        for kind, detected in _detected(scan, proposals):
            hits[f"recall of {kind}"].append(detected)
    text = {name: f"{np.median(v) if 'median' in name else np.mean(v):.4g}" for name, v in sums.items()}
    return text | {name: f"{100 * np.mean(v):.0f} % of {len(v)}" for name, v in sorted(hits.items())}


def _detected(scan: Scan, proposals: Proposals) -> Iterator[tuple[str, bool]]:
    """Class of each object of 20 points or more, and whether it is detected (point IoU over 1/2)."""
    number = proposals.label(len(scan.points))
    for members, kind, box in zip(scan.objects, scan.kinds, scan.boxes, strict=True):
        own = members[scan.points[members, 2] > box[2] + FOOT_M]
        if kind and scan.fov.depth(box[None, :3])[0] >= 0 and len(own) >= MIN_POINTS:
            shared = np.bincount(number[own] + 1, minlength=len(proposals) + 1)[1:]
            yield CLASS_NAMES[kind], bool((shared > 0.5 * (proposals.count + len(own) - shared)).any())


def main() -> None:
    options = parser(__doc__)
    options.add_argument("root", type=Path, help="KITTI root")
    options.add_argument("--scene", nargs="+", default=["street"])
    options.add_argument("--worlds", type=int, default=12, help="simulated worlds of each scene")
    options.add_argument("--sweeps", type=int, default=2, help="of each world")
    options.add_argument("--real", type=int, default=106, help="maximum number of real scans")
    args = options.parse_args()
    real = islice((s for s in object_scans(args.root / "object" / "training") if len(s.points) > 80000), args.real)
    times_s = np.linspace(0, 3.9, args.sweeps)
    synthetic = simulated_scans(args.scene, range(100, 100 + args.worlds), times_s.tolist(), camera=True)
    columns = figures(real), figures(synthetic)
    print("| figure | real | synthetic |\n|---|---|---|")
    for key in dict.fromkeys([*columns[0], *columns[1]]):
        print(f"| {key} | {columns[0].get(key, '-')} | {columns[1].get(key, '-')} |")


if __name__ == "__main__":
    main()
