"""Build a data set of crops from the synthetic world alone, in the format of tools/build_crops.py.

    build_synthetic_crops.py OUT.npz [--worlds N] [--labels DIR [--table FILE]] [--seed S]

Worlds are streets and crossings; with --labels every other world is built from a label file drawn from DIR, so that
objects stand as far, as turned and as hidden as real ones do. Label files of the test drive are left out, which
needs the table that says of what drive each one is (number, frame, drive by column).
"""

from __future__ import annotations

import argparse
import hashlib
import json
from collections.abc import Iterator
from pathlib import Path

import numpy as np

import modt
from build_crops import SHIPPED, counted, proposals_of
from labelled import TEST_DRIVE, Scan
from modt import profile
from modt.sources.synthetic import SyntheticStream
from modt.types import ObjectClass
from synthetic_scans import scan_of

SWEEPS_S, SECONDS = (0.0, 2.5), 4.0
RICH = ("Pedestrian", "Cyclist", "Person_sitting")


def label_files(folder: Path, table: Path) -> list[Path]:
    """Label files that may be learnt from; those with people stand for three others."""
    rows = (line.split("\t") for line in table.read_text(encoding="utf-8").splitlines())
    drive = {row[0]: row[2] for row in rows}
    files = [p for p in sorted(folder.glob("*.txt")) if drive.get(p.stem, TEST_DRIVE) != TEST_DRIVE]
    rich = [p for p in files if any(line.startswith(RICH) for line in p.read_text().splitlines())]
    return files + 3 * rich


def scans(worlds: int, files: list[Path], seed: int) -> Iterator[Scan]:
    """Labelled sweeps of as many worlds."""
    rng = np.random.default_rng(seed)
    for k in range(worlds):
        world_seed = seed * 100_000 + k
        if files and k % 2:
            path = files[int(rng.integers(len(files)))]
            simulator = SyntheticStream(str(path), "hdl-64e", 0.1, world_seed).simulator
            frame, truth = simulator.sweep(0)
            yield scan_of(frame, truth, f"{path.stem}-{k}", f"world-{k}")
            continue
        simulator = SyntheticStream(("street", "crossing")[k // 2 % 2], "hdl-64e", SECONDS, world_seed).simulator
        for time_s in SWEEPS_S:
            frame, truth = simulator.sweep(round(time_s / simulator.sensor.period_s))
            yield scan_of(frame, truth, f"world-{k}/{frame.index}", f"world-{k}", camera=False)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("out", type=Path, help="file to write (.npz)")
    parser.add_argument("--worlds", type=int, default=200)
    parser.add_argument("--labels", type=Path, help="folder of KITTI label files")
    parser.add_argument("--table", type=Path, help="drive of each label file")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--profile", default=profile.DEFAULT)
    args = parser.parse_args()
    files = label_files(args.labels, args.table) if args.labels and args.table else []
    config = profile.load(args.profile)
    columns: dict[str, list[np.ndarray]] = {k: [] for k in ("xyz", "count", "label", "partial", "variant", "box")}
    name, drive, truth_label, truth_drive = [], [], [], []
    for scan, variant, crops, kind, partial, box in proposals_of(scans(args.worlds, files, args.seed), config):
        parts = (crops.xyz, crops.count, kind, partial, np.full(len(kind), variant), box)
        for column, part in zip(columns.values(), parts, strict=True):
            column.append(part)
        name += [scan.name] * len(kind)
        drive += [scan.drive] * len(kind)
        if variant == SHIPPED:
            truth_label.append(counted(scan))
            truth_drive += [scan.drive] * len(truth_label[-1])
    whole = {k: np.concatenate(v) for k, v in columns.items()}
    provenance = {
        "modt": modt.__version__,
        "profile": profile.dump(config),
        "scans": len(set(name)),
        "drives": len(set(drive)),
        "synthetic": {"worlds": args.worlds, "seed": args.seed, "label_files": len(files)},
    }
    np.savez_compressed(
        args.out,
        xyz=whole["xyz"],
        offsets=np.append(0, np.cumsum(whole["count"])),
        label=whole["label"].astype(np.int8),
        partial=whole["partial"],
        variant=whole["variant"].astype(np.int8),
        box=whole["box"].astype(np.int16),
        scan=np.array(name),
        drive=np.array(drive),
        truth_label=np.concatenate(truth_label).astype(np.int8),
        truth_drive=np.array(truth_drive),
        provenance=json.dumps(provenance),
    )
    clear = ~whole["partial"] & (whole["variant"] == SHIPPED)
    tally = np.bincount(whole["label"][clear], minlength=len(ObjectClass))
    digest = hashlib.sha256(args.out.read_bytes()).hexdigest()
    print(json.dumps({"sha256": digest, **{c.name.lower(): int(n) for c, n in zip(ObjectClass, tally, strict=True)}}))


if __name__ == "__main__":
    main()
