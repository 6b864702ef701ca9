"""Build the data set of crops: the proposals of our own segmentation over labelled scans, labelled by overlap.

    build_crops.py KITTI_ROOT OUT.npz

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
from itertools import chain
from pathlib import Path

import numpy as np

import modt
from dataset import SHIPPED
from labelled import CLASS_OF, Scan, inside, object_scans, raw_scans
from modt import profile
from modt.classification.crops import Crops, gather
from modt.config import ProfileConfig
from modt.segmentation.segmenter import Segmenter
from modt.types import Bool, Int, ObjectClass, Proposals

CELL_SCALES = (1.0, 0.75, 1.4)
"""The segmentation as it ships first; the others cluster finer and coarser, for training alone."""
MAX_POINTS = 1200
MIN_BOX_POINTS, COUNTED_BOX_POINTS = 5, 10
"""An object must show so many points to be trained on, and to be counted as one that should be found."""


def label(scan: Scan, proposals: Proposals) -> tuple[Int, Bool, Int]:
    """Class of each proposal, whether it is unclear, and the box that it shows (NONE where none)."""
    number = proposals.label(len(scan.points))
    size = proposals.count
    kind = np.full(len(proposals), ObjectClass.BACKGROUND, np.int64)
    box_of = np.full(len(proposals), -1, np.int64)
    left_out = np.bincount(number[scan.unlabelled & (number >= 0)], minlength=len(proposals))
    partial = left_out > 0.5 * size
    for b, (box, name) in enumerate(zip(scan.boxes, scan.kinds, strict=True)):
        own = number[inside(scan.points, box)]
        if len(own) < MIN_BOX_POINTS:
            continue
        shared = np.bincount(own[own >= 0], minlength=len(proposals))
        whole = (shared > 0.5 * size) & (shared > 0.5 * len(own))
        box_of[whole] = b
        kind[whole] = CLASS_OF.get(name, ObjectClass.BACKGROUND)
        partial |= (shared > 0.2 * size) & ~whole
        partial[whole] = False
    return kind, partial, box_of


def counted(scan: Scan) -> Int:
    """Classes of the objects that a detector should find in a scan."""
    visible = [scan.fov.contains(scan.points) & inside(scan.points, box) for box in scan.boxes]
    return np.array(
        [
            CLASS_OF[name]
            for name, own in zip(scan.kinds, visible, strict=True)
            if name in CLASS_OF and own.sum() >= COUNTED_BOX_POINTS
        ],
        np.int64,
    )


def proposals_of(scans: Iterable[Scan], config: ProfileConfig) -> Iterator[tuple[Scan, int, Crops, Int, Bool, Int]]:
    for scan in scans:
        for variant, scale in enumerate(CELL_SCALES):
            stage = dataclasses.replace(config.segmentation, cell_m=config.segmentation.cell_m * scale)
            proposals = Segmenter(stage, config.sensor, scan.fov).segment(scan.points)
            crops = gather(scan.points, proposals, np.arange(len(proposals)), MAX_POINTS)
            yield scan, variant, crops, *label(scan, proposals)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("root", type=Path, help="KITTI root")
    parser.add_argument("out", type=Path, help="file to write (.npz)")
    parser.add_argument("--profile", default=profile.DEFAULT)
    args = parser.parse_args()
    config = profile.load(args.profile)
    scans = chain(
        object_scans(args.root / "object" / "training"),
        raw_scans(args.root / "raw" / "2011_09_26" / "2011_09_26_drive_0001_sync"),
    )
    xyz, count, kind, partial, variant, name, drive, box = [], [], [], [], [], [], [], []
    truth_label, truth_drive = [], []
    for scan, v, crops, k, p, b in proposals_of(scans, config):
        xyz.append(crops.xyz)
        count.append(crops.count)
        kind.append(k)
        partial.append(p)
        variant.append(np.full(len(k), v))
        name += [scan.name] * len(k)
        drive += [scan.drive] * len(k)
        box.append(b)
        if v == SHIPPED:
            truth_label.append(counted(scan))
            truth_drive += [scan.drive] * len(truth_label[-1])
    labels = np.concatenate(kind)
    provenance = {
        "modt": modt.__version__,
        "profile": profile.dump(config),
        "scans": len(set(name)),
        "drives": len(set(drive)),
    }
    np.savez_compressed(
        args.out,
        xyz=np.concatenate(xyz),
        offsets=np.append(0, np.cumsum(np.concatenate(count))),
        label=labels.astype(np.int8),
        partial=np.concatenate(partial),
        variant=np.concatenate(variant).astype(np.int8),
        box=np.concatenate(box).astype(np.int16),
        scan=np.array(name),
        drive=np.array(drive),
        truth_label=np.concatenate(truth_label).astype(np.int8),
        truth_drive=np.array(truth_drive),
        provenance=json.dumps(provenance),
    )
    digest = hashlib.sha256(args.out.read_bytes()).hexdigest()
    clear = ~np.concatenate(partial) & (np.concatenate(variant) == SHIPPED)
    tally = np.bincount(labels[clear], minlength=len(ObjectClass))
    print(json.dumps({"sha256": digest, **{c.name.lower(): int(n) for c, n in zip(ObjectClass, tally, strict=True)}}))


if __name__ == "__main__":
    main()
