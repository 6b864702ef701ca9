"""Compare simulated sweeps with real ones: points, proposals, sizes and recall.

    python -m tools.study.compare_synthetic KITTI_ROOT [--scene NAME ...] [--worlds N] [--sweeps N] [--real N]

Real: the full scans of the object benchmark. Simulated: a few sweeps of several worlds. The segmentation and the
statistics are the same for both.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable
from itertools import islice, pairwise
from pathlib import Path

import numpy as np

from modt import profile
from modt.classes import CLASS_NAMES
from modt.geometry import FieldOfView
from modt.segmentation.segmenter import Segmenter
from modt_desk.evaluation.overlap import FOOT_M
from tools.options import parser
from tools.train.labelled_scans import Scan, object_scans
from tools.train.synthetic_scans import simulated_scans

RINGS = (5, 10, 15, 20, 30, 50)


def figures(scans: Iterable[Scan]) -> dict[str, str]:
    """Statistics of a set of scans, as text."""
    config = profile.load()
    whole = Segmenter(config.segmentation, config.sensor, FieldOfView())
    sums: dict[str, list[float]] = defaultdict(list)
    hits: dict[str, list[bool]] = defaultdict(list)
    for scan in scans:
        p = scan.points
        rho, z = np.hypot(p[:, 0], p[:, 1]), p[:, 2]
        sums["points a sweep"].append(len(p))
        for near, far in pairwise(RINGS):
            ring = (rho >= near) & (rho < far)
            sums[f"points {near}-{far} m, low (z < -1.3 m)"].append(float((ring & (z < -1.3)).sum()))
            sums[f"points {near}-{far} m, upright (z -1.3 to 0.9 m)"].append(
                float((ring & (z > -1.3) & (z < 0.9)).sum())
            )
        sums["points beyond 50 m"].append(float((rho > 50).sum()))
        sums["points above 0.9 m over the sensor"].append(float((z > 0.9).sum()))
        sums["reflectance, median"].append(float(np.median(p[:, 3])))
        front = Segmenter(config.segmentation, config.sensor, scan.fov)
        for place, segmenter in (("full", whole), ("camera", front)):
            s = segmenter.segment(p)
            sums[f"proposals, {place}"].append(len(s))
            for q in (25, 50, 75, 90):
                sums[f"points of a proposal, {place}, {q}%"].append(float(np.percentile(s.count, q)) if len(s) else 0)
            if place == "full" and len(s):
                for name, column in (("length", 3), ("width", 4), ("height", 5)):
                    for q in (25, 50, 75):
                        sums[f"{name} of a proposal, {q}%"].append(float(np.percentile(s.box[:, column], q)))
                away = np.hypot(s.centroid[:, 0], s.centroid[:, 1])
                for near, far in ((0, 10), (10, 20), (20, 40), (40, 80)):
                    sums[f"proposals {near}-{far} m"].append(float(((away >= near) & (away < far)).sum()))
        _objects(scan, front, sums, hits)
    text = {k: f"{np.mean(v):.4g}" for k, v in sums.items() if not k.startswith("n ")}
    text |= {k: f"{100 * np.mean(v):.0f} % of {len(v)}" for k, v in sorted(hits.items())}
    return text | {k[2:]: f"{np.median(v):.0f} ({len(v)})" for k, v in sorted(sums.items()) if k.startswith("n ")}


def _objects(scan: Scan, segmenter: Segmenter, sums: dict[str, list[float]], hits: dict[str, list[bool]]) -> None:
    proposals = segmenter.segment(scan.points)
    number = proposals.label(len(scan.points))
    for members, kind, box in zip(scan.objects, scan.kinds, scan.boxes, strict=True):
        own = members[scan.points[members, 2] > box[2] + FOOT_M]
        if not kind or scan.fov.depth(box[None, :3])[0] < 0:
            continue
        n, away = len(own), float(np.hypot(box[0], box[1]))
        name = CLASS_NAMES[kind]
        for near, far in zip((0, *RINGS[:-1]), RINGS, strict=True):
            if near <= away < far and n >= 5:
                sums[f"n points on a {name} at {near:02d}-{far} m, median (count)"].append(n)
        if n >= 20:
            shared = np.bincount(number[own][number[own] >= 0], minlength=len(proposals))
            best = int(shared.argmax()) if len(shared) else 0
            overlap = shared[best] / (proposals.count[best] + n - shared[best]) if len(shared) else 0.0
            hits[f"recall of {name}"].append(bool(overlap > 0.5))


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
