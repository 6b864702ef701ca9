"""Build a data set of crops from simulated sweeps of low sensors among people at arm's length, as build_crops does.

    python -m tools.train.build_near_crops OUT.npz [--worlds N] [--seed S]

Every simulated sensor in turn, 0.2 to 1.0 m above the floor; people, furniture, posts, crates, trees and cars at 0.5
to 6 m, as its beams cut them.
"""

from __future__ import annotations

import json
from itertools import cycle

from tools.options import crops_parser
from tools.train.build_crops import CropWriter
from tools.train.build_synthetic_crops import CELL_SCALES
from tools.train.dataset import SYNTHETIC
from tools.train.near_scans import near_scans


def main() -> None:
    parser = crops_parser(__doc__, seed=1)
    parser.add_argument("--worlds", type=int, default=1100, help="one sweep of each (default: %(default)s)")
    args = parser.parse_args()
    writer, first = CropWriter(), args.seed * 100_000
    for scan, scale in zip(near_scans(range(first, first + args.worlds)), cycle(CELL_SCALES), strict=False):
        writer.add(scan, SYNTHETIC, scale, validation=True)
    print(json.dumps(writer.save(args.out, {"near": args.worlds, "seed": args.seed})))


if __name__ == "__main__":
    main()
