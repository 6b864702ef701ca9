"""Build a data set of crops from simulated sweeps, in the format of build_crops.

    python -m tools.train.build_synthetic_crops OUT.npz [--worlds N]
                         [--labels KITTI_ROOT/object/training_all_labels] [--seed S]

Worlds are streets and crossings, seen by every simulated sensor in turn; with --labels the same number again is built
from KITTI label files, whose ranges, headings and occlusions are those of real objects.
"""

from __future__ import annotations

import json
from itertools import chain, cycle
from pathlib import Path

from modt_desk.simulation.sensors import SENSORS
from tools.options import crops_parser
from tools.train.build_crops import CropWriter
from tools.train.dataset import SYNTHETIC
from tools.train.synthetic_scans import label_files, scans_from_labels, simulated_scans

SCENES, TIMES_S = ("street", "crossing"), (0.0, 2.5)
CELL_SCALES = (0.75, 1.0, 1.0, 1.4)
"""Cell sizes relative to the profile's, scan by scan."""


def main() -> None:
    parser = crops_parser(__doc__, seed=1)
    parser.add_argument("--worlds", type=int, default=100, help="of each kind")
    parser.add_argument("--labels", type=Path, help="folder with label_2/ and frame_to_raw.tsv")
    args = parser.parse_args()
    writer = CropWriter()
    first = args.seed * 100_000
    sensors, seeds = tuple(SENSORS), range(first, first + args.worlds)
    scans = simulated_scans(SCENES, seeds[: args.worlds // 2], TIMES_S, camera=False, sensors=sensors)
    if args.labels:
        scans = chain(scans, scans_from_labels(label_files(args.labels), seeds, sensors))
    for scan, scale in zip(scans, cycle(CELL_SCALES), strict=False):
        writer.add(scan, SYNTHETIC, scale, validation=True)
    provenance: dict[str, object] = {"synthetic": args.worlds, "placed": bool(args.labels), "seed": args.seed}
    print(json.dumps(writer.save(args.out, provenance)))


if __name__ == "__main__":
    main()
