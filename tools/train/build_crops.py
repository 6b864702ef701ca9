"""Build the data set of crops: the proposals of our own segmentation over labelled scans, labelled by overlap.

    python -m tools.train.build_crops OUT.npz --kitti ROOT [--paste N]

A proposal is an object if more than half of its points lie in the object's box and it holds more than half of those
that do. What is neither clearly that nor clearly something else (fragments, merged objects) is kept but marked
partial; what the annotators left out is marked unknown. Neither is trained on, and what is unknown is not judged.
What the camera of KITTI's scans does not see is kept apart, without labels, for teachers (tools/train/teaching.py).
The file carries its own provenance. tools/train/build_synthetic_crops.py writes the same of synthetic scans.
"""

from __future__ import annotations

import argparse
import dataclasses
import hashlib
import json
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

import modt
from modt import profile
from modt.classes import ObjectClass
from modt.classification.crops import gather
from modt.config import ProfileConfig
from modt.geometry import FieldOfView
from modt.segmentation.segmenter import Segmenter
from modt.types import N_REFLECTANCE, Bool, Float64, Int, Proposals
from tools.train.dataset import CLUSTERED, PASTED, SHIPPED, SYNTHETIC, UNLABELLED
from tools.train.labelled_scans import Scan, argoverse_scans, object_scans, raw_scans, semantic_scans
from tools.train.paste import library, pasted

CELL_SCALES = (0.75, 1.4)
"""Finer and coarser clusters than those of the segmentation that ships, for training alone."""
MAX_POINTS = 1200
MIN_BOX_POINTS, COUNTED_BOX_POINTS = 5, 10
"""An object must show so many points to be trained on, and to be counted as one that should be found."""
TALL_M = 1.85
"""Cars taller than this are vans and their like."""


@dataclass(frozen=True)
class Labels:
    """What the proposals of a scan are.

    Attributes:
        kind: (R,) class.
        partial: (R,) neither clearly one object nor clearly none.
        unknown: (R,) not to be judged by: background beyond the labels, or an object with too few points.
        tall: (R,) vehicles the height of a van: rare, and unlike other cars.
    """

    kind: Int
    partial: Bool
    unknown: Bool
    tall: Bool


def label(scan: Scan, proposals: Proposals) -> Labels:
    """The proposals of a scan, labelled by overlap with its objects."""
    number = proposals.label(len(scan.points))
    size = proposals.count
    kind = np.full(len(proposals), ObjectClass.BACKGROUND, np.int64)
    left_out = np.bincount(number[scan.unlabelled & (number >= 0)], minlength=len(proposals))
    partial, tall = np.zeros(len(proposals), np.bool_), np.zeros(len(proposals), np.bool_)
    unknown = left_out > 0.5 * size
    for members, of_class, box, to_find in zip(scan.objects, scan.kinds, scan.boxes, countable(scan), strict=True):
        if len(members) < MIN_BOX_POINTS:
            continue
        own = number[members]
        shared = np.bincount(own[own >= 0], minlength=len(proposals))
        whole = (shared > 0.5 * size) & (shared > 0.5 * len(own))
        kind[whole] = of_class
        tall[whole] = of_class == ObjectClass.CAR and box[5] > TALL_M
        partial |= (shared > 0.2 * size) & ~whole
        partial[whole] = False
        unknown[whole] = not to_find
    return Labels(kind, partial, unknown, tall)


def told(proposals: Proposals) -> Float64:
    """(P, 5) of the proposals' returns, NaN where the scan does not tell."""
    if proposals.reflectance is None:
        return np.full((len(proposals), N_REFLECTANCE), np.nan)
    return proposals.reflectance


def countable(scan: Scan) -> Bool:
    """(B,) objects that a detector should find in a scan."""
    points = [int(scan.fov.contains(scan.points[own]).sum()) for own in scan.objects]
    return np.array([n >= COUNTED_BOX_POINTS for n in points], np.bool_)


class Writer:
    """Gathers crops."""

    def __init__(self, config: ProfileConfig) -> None:
        self.config = config
        self.columns: dict[str, list[np.ndarray]] = {}

    def add(self, scan: Scan, variant: int, scale: float = 1.0, *, judged: bool = False) -> None:
        """The proposals of a scan, clusters so much coarser; if judged, its objects count as to be found."""
        stage = dataclasses.replace(self.config.segmentation, cell_m=self.config.segmentation.cell_m * scale)
        proposals = Segmenter(stage, self.config.sensor, scan.fov).segment(scan.points)
        labels = label(scan, proposals)
        objects = (labels.kind > 0) & ~labels.partial
        of_interest = {PASTED: objects, UNLABELLED: labels.unknown & (labels.kind == 0) & ~labels.partial}
        kept = np.flatnonzero(of_interest.get(variant, np.ones(len(proposals), np.bool_)))
        crops = gather(scan.points, proposals, kept, MAX_POINTS)
        n = len(kept)
        row = {"xyz": crops.xyz, "count": crops.count, "label": labels.kind[kept].astype(np.int8)}
        row |= {"partial": labels.partial[kept], "unknown": labels.unknown[kept], "tall": labels.tall[kept]}
        row |= {"variant": np.full(n, variant, np.int8), "reflectance": told(proposals)[kept]}
        row |= {"scan": np.array([scan.name] * n, np.str_), "drive": np.array([scan.drive] * n, np.str_)}
        if judged:
            truth = np.array(scan.kinds, np.int64)[countable(scan)]
            truth = truth[truth > ObjectClass.BACKGROUND]
            row |= {"truth_label": truth.astype(np.int8), "truth_drive": np.array([scan.drive] * len(truth), np.str_)}
        for key, value in row.items():
            self.columns.setdefault(key, []).append(value)

    def save(self, path: Path, provenance: dict[str, object]) -> dict[str, object]:
        """Write it all; returns how many clear crops of each class and variant there are."""
        table = {key: np.concatenate(parts) for key, parts in self.columns.items()}
        table["offsets"] = np.append(0, np.cumsum(table.pop("count")))
        table.setdefault("truth_label", np.zeros(0, np.int8))
        table.setdefault("truth_drive", np.zeros(0, np.str_))
        clear = ~table["partial"] & ~(table["unknown"] & (table["label"] == 0))
        tally = {
            name: np.bincount(table["label"][clear & (table["variant"] == v)], minlength=4).tolist()
            for name, v in {
                "shipped": SHIPPED,
                "clustered": CLUSTERED,
                "pasted": PASTED,
                "synthetic": SYNTHETIC,
            }.items()
        }
        provenance |= {"scans": len(np.unique(table["scan"])), "crops": tally, "modt": modt.__version__}
        provenance |= {"unlabelled": int(np.count_nonzero(table["variant"] == UNLABELLED))}
        provenance |= {"profile": profile.dump(self.config)}
        np.savez_compressed(path, provenance=np.array(json.dumps(provenance)), **table)
        return {"sha256": hashlib.sha256(path.read_bytes()).hexdigest(), **tally}


def kitti(root: Path) -> Iterator[Scan]:
    """Every labelled scan that is not of the test drive."""
    yield from object_scans(root / "object" / "training")
    yield from raw_scans(root / "raw" / "2011_09_26" / "2011_09_26_drive_0001_sync")


def add_kitti(writer: Writer, root: Path, pastes: int, seed: int) -> None:
    """Real scans, and real objects pasted into them."""
    scans = list(kitti(root))
    for scan in scans:
        writer.add(scan, SHIPPED, judged=True)
        for scale in CELL_SCALES:
            writer.add(scan, CLUSTERED, scale)
        writer.add(dataclasses.replace(scan, fov=FieldOfView()), UNLABELLED)
    for scan in (*semantic_scans(root / "odometry"), *argoverse_scans(root / "argoverse2")):
        writer.add(scan, CLUSTERED)
    items = library(scans)
    rng = np.random.default_rng(seed)
    hosts: Iterable[Scan] = [scan for scan in scans if len(scan.points) > 60_000]
    for scan in hosts if pastes else ():
        for made in pasted(scan, items, pastes, rng):
            writer.add(made, PASTED)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("out", type=Path, help="file to write (.npz)")
    parser.add_argument("--kitti", type=Path, required=True, help="KITTI root")
    parser.add_argument("--paste", type=int, default=0, help="objects to try to paste into each real scan")
    parser.add_argument("--profile", default=profile.DEFAULT)
    parser.add_argument("--seed", type=int, default=0)
    args = parser.parse_args()
    writer = Writer(profile.load(args.profile))
    add_kitti(writer, args.kitti, args.paste, args.seed)
    print(json.dumps(writer.save(args.out, {"paste": args.paste, "seed": args.seed})))


if __name__ == "__main__":
    main()
