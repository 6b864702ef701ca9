"""Build a data set of crops from the synthetic world alone, in the format of tools/train/build_crops.py.

    python -m tools.train.build_synthetic_crops OUT.npz [--worlds N]
                         [--labels KITTI_ROOT/object/training_all_labels] [--seed S]

Worlds are streets and crossings; with --labels there are as many again that are built from label files, so that
objects stand as far, as turned and as hidden as real ones do.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path

from modt import profile
from tools.train.build_crops import Writer
from tools.train.dataset import SYNTHETIC
from tools.train.synthetic_scans import driven, label_files, placed

SCENES, TIMES_S = ("street", "crossing"), (0.0, 2.5)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("out", type=Path, help="file to write (.npz)")
    parser.add_argument("--worlds", type=int, default=100, help="of each sort")
    parser.add_argument("--labels", type=Path, help="folder with label_2/ and frame_to_raw.tsv")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--profile", default=profile.DEFAULT)
    args = parser.parse_args()
    writer = Writer(profile.load(args.profile))
    first = args.seed * 100_000
    for k, scan in enumerate(driven(SCENES, range(first, first + args.worlds // 2), TIMES_S, camera=False)):
        writer.add(scan, SYNTHETIC, (0.75, 1.0, 1.0, 1.4)[k % 4])
    if args.labels:
        for k, scan in enumerate(placed(label_files(args.labels), range(first, first + args.worlds))):
            writer.add(scan, SYNTHETIC, (0.75, 1.0, 1.0, 1.4)[k % 4])
    asked = {"synthetic": args.worlds, "placed": bool(args.labels), "seed": args.seed}
    print(json.dumps(writer.save(args.out, dict(asked))))


if __name__ == "__main__":
    main()
