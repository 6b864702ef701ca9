"""Build the data set of crops: the proposals of our own segmentation over labelled scans, labelled by overlap.

    build_crops.py OUT.npz [--kitti ROOT [--paste N]] [--synthetic N]

A proposal is an object if more than half of its points lie in the object's box and it holds more than half of those
that do. What is neither clearly that nor clearly something else (fragments, merged objects, regions that the
annotators left out) is kept but marked partial. The file carries its own provenance.
"""

from __future__ import annotations

import argparse
import dataclasses
import hashlib
import json
from collections.abc import Iterable, Iterator
from pathlib import Path

import numpy as np

import modt
from dataset import CLUSTERED, PASTED, SHIPPED, SYNTHETIC
from labelled import Scan, object_scans, raw_scans, semantic_scans, synthetic_scans
from modt import profile
from modt.classification.crops import gather
from modt.config import ProfileConfig
from modt.segmentation.segmenter import Segmenter
from modt.types import Bool, Int, ObjectClass, Proposals
from paste import library, pasted

CELL_SCALES = (0.75, 1.4)
"""Finer and coarser clusters than those of the segmentation that ships, for training alone."""
MAX_POINTS = 1200
MIN_BOX_POINTS, COUNTED_BOX_POINTS = 5, 10
"""An object must show so many points to be trained on, and to be counted as one that should be found."""


def label(scan: Scan, proposals: Proposals) -> tuple[Int, Bool]:
    """Class of each proposal, and whether it is unclear."""
    number = proposals.label(len(scan.points))
    size = proposals.count
    kind = np.full(len(proposals), ObjectClass.BACKGROUND, np.int64)
    left_out = np.bincount(number[scan.unlabelled & (number >= 0)], minlength=len(proposals))
    partial = left_out > 0.5 * size
    for members, of_class in zip(scan.objects, scan.kinds, strict=True):
        if len(members) < MIN_BOX_POINTS:
            continue
        own = number[members]
        shared = np.bincount(own[own >= 0], minlength=len(proposals))
        whole = (shared > 0.5 * size) & (shared > 0.5 * len(own))
        kind[whole] = of_class
        partial |= (shared > 0.2 * size) & ~whole
        partial[whole] = False
    return kind, partial


def counted(scan: Scan) -> Int:
    """Classes of the objects that a detector should find in a scan."""
    points = [int(scan.fov.contains(scan.points[own]).sum()) for own in scan.objects]
    kinds = [k for k, n in zip(scan.kinds, points, strict=True) if k and n >= COUNTED_BOX_POINTS]
    return np.array(kinds, np.int64)


class Writer:
    """Gathers crops."""

    def __init__(self, config: ProfileConfig) -> None:
        self.config = config
        self.columns: dict[str, list[np.ndarray]] = {}

    def add(self, scan: Scan, variant: int, scale: float = 1.0, *, judged: bool = False) -> None:
        """The proposals of a scan, clusters so much coarser; if judged, its objects count as to be found."""
        stage = dataclasses.replace(self.config.segmentation, cell_m=self.config.segmentation.cell_m * scale)
        proposals = Segmenter(stage, self.config.sensor, scan.fov).segment(scan.points)
        kind, partial = label(scan, proposals)
        wanted = ~partial & (kind > 0) if variant == PASTED else np.ones(len(proposals), np.bool_)
        kept = np.flatnonzero(wanted)
        crops = gather(scan.points, proposals, kept, MAX_POINTS)
        n = len(kept)
        row = {"xyz": crops.xyz, "count": crops.count, "label": kind[kept].astype(np.int8), "partial": partial[kept]}
        row |= {"variant": np.full(n, variant, np.int8)}
        row |= {"scan": np.array([scan.name] * n, np.str_), "drive": np.array([scan.drive] * n, np.str_)}
        if judged:
            truth = counted(scan)
            row |= {"truth_label": truth.astype(np.int8), "truth_drive": np.array([scan.drive] * len(truth), np.str_)}
        for key, value in row.items():
            self.columns.setdefault(key, []).append(value)

    def save(self, path: Path, provenance: dict[str, object]) -> dict[str, object]:
        """Write it all; returns how many clear crops of each class and variant there are."""
        table = {key: np.concatenate(parts) for key, parts in self.columns.items()}
        table["offsets"] = np.append(0, np.cumsum(table.pop("count")))
        table.setdefault("truth_label", np.zeros(0, np.int8))
        table.setdefault("truth_drive", np.zeros(0, np.str_))
        clear = ~table["partial"]
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
    for scan in semantic_scans(root / "odometry"):
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
    parser.add_argument("--kitti", type=Path, help="KITTI root")
    parser.add_argument("--paste", type=int, default=0, help="objects to try to paste into each real scan")
    parser.add_argument("--synthetic", type=int, default=0, help="synthetic worlds")
    parser.add_argument("--each", type=int, default=8, help="sweeps of each synthetic world")
    parser.add_argument("--profile", default=profile.DEFAULT)
    parser.add_argument("--seed", type=int, default=0)
    args = parser.parse_args()
    writer = Writer(profile.load(args.profile))
    if args.kitti:
        add_kitti(writer, args.kitti, args.paste, args.seed)
    for scan in synthetic_scans(range(1, 1 + args.synthetic), args.each):
        writer.add(scan, SYNTHETIC, judged=True)
    asked = {"kitti": bool(args.kitti), "paste": args.paste, "synthetic": args.synthetic, "each": args.each}
    print(json.dumps(writer.save(args.out, {**asked, "seed": args.seed})))


if __name__ == "__main__":
    main()
