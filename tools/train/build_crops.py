"""Build a data set of crops from real scans: proposals of the segmentation, labelled by overlap with objects.

    python -m tools.train.build_crops OUT.npz --kitti ROOT [--paste N]

A proposal takes the class of an object if they share more than half of the points of each. Fragments and merged
objects are marked partial, proposals outside the annotated regions unknown. Neither is used for training; unknown
ones are not validated either. Proposals outside KITTI's camera view are stored without labels, for distillation
(tools.train.distillation). The file contains its provenance.
"""

from __future__ import annotations

import dataclasses
import hashlib
import json
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

import modt
from modt import profile
from modt.classes import ObjectClass
from modt.classification.crops import gather
from modt.config import ProfileConfig
from modt.geometry import FieldOfView
from modt.segmentation.segmenter import Segmenter
from modt.types import N_REFLECTANCE, Bool, Float64, Int, Proposals
from tools.options import crops_parser
from tools.train.dataset import CLUSTERED, PASTED, SHIPPED, SYNTHETIC, UNLABELLED
from tools.train.labelled_scans import Scan, argoverse_scans, object_scans, raw_scans, semantic_scans
from tools.train.paste import cut_objects, paste_objects

CELL_SCALES = (0.75, 1.4)
"""Cell sizes relative to the profile's, for training alone."""
MAX_POINTS = 1200
MIN_BOX_POINTS, MIN_DETECTABLE_POINTS = 5, 10
"""Minimum points of an object for training, and for the ground truth of the validation."""
TALL_M = 1.85
"""Minimum height of a van."""


@dataclass(frozen=True)
class Labels:
    """Labels of the proposals of a scan.

    Attributes:
        kind: (R,) class.
        partial: (R,) fragment or merged objects.
        unknown: (R,) excluded from validation: outside the annotated regions, or an object with too few points.
        tall: (R,) vehicles of at least TALL_M; rare, and different in shape from other cars.
    """

    kind: Int
    partial: Bool
    unknown: Bool
    tall: Bool


def label(scan: Scan, proposals: Proposals) -> Labels:
    """Label the proposals of a scan by overlap with its objects."""
    number = proposals.label(len(scan.points))
    size = proposals.count
    kind = np.full(len(proposals), ObjectClass.BACKGROUND, np.int64)
    outside = np.bincount(number[scan.unlabelled & (number >= 0)], minlength=len(proposals))
    partial, tall = np.zeros(len(proposals), np.bool_), np.zeros(len(proposals), np.bool_)
    unknown = outside > 0.5 * size
    for members, object_class, box, valid in zip(scan.objects, scan.kinds, scan.boxes, detectable(scan), strict=True):
        if len(members) < MIN_BOX_POINTS:
            continue
        own = number[members]
        shared = np.bincount(own[own >= 0], minlength=len(proposals))
        whole = (shared > 0.5 * size) & (shared > 0.5 * len(own))
        kind[whole] = object_class
        tall[whole] = object_class == ObjectClass.CAR and box[5] > TALL_M
        partial |= (shared > 0.2 * size) & ~whole
        partial[whole] = False
        unknown[whole] = not valid
    return Labels(kind, partial, unknown, tall)


def reflectance_of(proposals: Proposals) -> Float64:
    """(P, 5) reflectance statistics of proposals, NaN where not measured."""
    if proposals.reflectance is None:
        return np.full((len(proposals), N_REFLECTANCE), np.nan)
    return proposals.reflectance


def detectable(scan: Scan) -> Bool:
    """(B,) objects with enough points in the annotated field of view."""
    points = [int(scan.fov.contains(scan.points[own]).sum()) for own in scan.objects]
    return np.array([n >= MIN_DETECTABLE_POINTS for n in points], np.bool_)


class CropWriter:
    """Collects crops and writes the data set."""

    def __init__(self, config: ProfileConfig) -> None:
        self.config = config
        self.columns: dict[str, list[Any]] = {}

    def add(self, scan: Scan, variant: int, scale: float = 1.0, *, validation: bool = False) -> None:
        """Add the proposals of a scan at `scale` times the profile's cell size; for validation with its objects."""
        stage = dataclasses.replace(self.config.segmentation, cell_m=self.config.segmentation.cell_m * scale)
        proposals = Segmenter(stage, self.config.sensor, scan.fov).segment(scan.points)
        labels = label(scan, proposals)
        objects = (labels.kind > 0) & ~labels.partial
        of_interest = {PASTED: objects, UNLABELLED: labels.unknown & (labels.kind == 0) & ~labels.partial}
        kept = np.flatnonzero(of_interest.get(variant, np.ones(len(proposals), np.bool_)))
        crops = gather(scan.points, proposals, kept, MAX_POINTS)
        n = len(kept)
        row: dict[str, Any] = {"xyz": crops.xyz, "count": crops.count, "label": labels.kind[kept].astype(np.int8)}
        row |= {"partial": labels.partial[kept], "unknown": labels.unknown[kept], "tall": labels.tall[kept]}
        row |= {"variant": np.full(n, variant, np.int8), "reflectance": reflectance_of(proposals)[kept]}
        row |= {"scan": np.array([scan.name] * n, np.str_), "drive": np.array([scan.drive] * n, np.str_)}
        if validation:
            truth = np.array(scan.kinds, np.int64)[detectable(scan)]
            truth = truth[truth > ObjectClass.BACKGROUND]
            row |= {"truth_label": truth.astype(np.int8), "truth_drive": np.array([scan.drive] * len(truth), np.str_)}
        for key, value in row.items():
            self.columns.setdefault(key, []).append(value)

    def save(self, path: Path, provenance: dict[str, object]) -> dict[str, object]:
        """Write the file; returns its hash and the number of trainable crops by variant and class."""
        table: dict[str, Any] = {key: np.concatenate(parts) for key, parts in self.columns.items()}
        table["offsets"] = np.append(0, np.cumsum(table.pop("count")))
        table.setdefault("truth_label", np.zeros(0, np.int8))
        table.setdefault("truth_drive", np.zeros(0, np.str_))
        trainable = ~table["partial"] & ~(table["unknown"] & (table["label"] == 0))
        tally = {
            name: np.bincount(table["label"][trainable & (table["variant"] == v)], minlength=4).tolist()
            for name, v in (
                ("shipped", SHIPPED),
                ("clustered", CLUSTERED),
                ("pasted", PASTED),
                ("synthetic", SYNTHETIC),
            )
        }
        provenance |= {"scans": len(np.unique(table["scan"])), "crops": tally, "modt": modt.__version__}
        provenance |= {"unlabelled": int(np.count_nonzero(table["variant"] == UNLABELLED))}
        provenance |= {"profile": profile.dump(self.config)}
        np.savez_compressed(path, provenance=np.array(json.dumps(provenance)), **table)
        return {"sha256": hashlib.sha256(path.read_bytes()).hexdigest(), **tally}


def kitti(root: Path) -> Iterator[Scan]:
    """Labelled scans of KITTI except those of the test drive."""
    yield from object_scans(root / "object" / "training")
    yield from raw_scans(root / "raw" / "2011_09_26" / "2011_09_26_drive_0001_sync")


def add_kitti(writer: CropWriter, root: Path, pastes: int, seed: int) -> None:
    """Add real scans, and real scans with pasted objects."""
    scans = list(kitti(root))
    for scan in scans:
        writer.add(scan, SHIPPED, validation=True)
        for scale in CELL_SCALES:
            writer.add(scan, CLUSTERED, scale)
        writer.add(dataclasses.replace(scan, fov=FieldOfView()), UNLABELLED)
    for scan in (*semantic_scans(root / "odometry"), *argoverse_scans(root / "argoverse2")):
        writer.add(scan, CLUSTERED)
    cuts = cut_objects(scans)
    rng = np.random.default_rng(seed)
    hosts: Iterable[Scan] = [scan for scan in scans if len(scan.points) > 60_000]
    for scan in hosts if pastes else ():
        for made in paste_objects(scan, cuts, pastes, rng):
            writer.add(made, PASTED)


def main() -> None:
    parser = crops_parser(__doc__, seed=0)
    parser.add_argument("--kitti", type=Path, required=True, help="KITTI root")
    parser.add_argument("--paste", type=int, default=0, help="pasting attempts in each real scan")
    args = parser.parse_args()
    writer = CropWriter(profile.load(args.profile))
    add_kitti(writer, args.kitti, args.paste, args.seed)
    print(json.dumps(writer.save(args.out, {"paste": args.paste, "seed": args.seed})))


if __name__ == "__main__":
    main()
