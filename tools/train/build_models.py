"""Build models from scratch: crops, training, export, cards (extra [train]).

    python -m tools.train.build_models WORK_DIR [--kitti ROOT] [--scans FOLDER --profile PROFILE] [--further]

Rebuilds models/pointnet-synthetic and, where KITTI's data are given, models/pointnet-kitti. With --further it trains
the shipped ones on sweeps of heaps, people, riders and worn sensors alone (tools.train.train_further), and then the
networks beside them, which takes minutes. With --scans it builds WORK_DIR/pointnet-scans instead, from your own
labelled scans, the simulator and, where given, KITTI's data. The scans have the layout of KITTI's object benchmark
and are named DRIVE_NUMBER: drives are never split in the validation. Without calib/ the labels must cover the full
circle, in a camera frame at the sensor (x right, y down, z forward).
"""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

from modt import profile
from tools.options import parser
from tools.train.build_crops import (
    FEW_BEAMS,
    FEW_POINTS,
    OF_ROBOTS,
    kitti_crops,
    own_crops,
    simulated_crops,
    street_crops,
    synthetic_crops,
)

MODELS = Path(__file__).resolve().parents[2] / "models"
WORLDS = 240
"""Simulated worlds of each kind."""
NEAR_WORLDS = {1: 2400, 2: 220}
"""Seed and number of the worlds near the sensor, first for training, then for the card."""
NEAR_STEPS = 4000
"""Training steps of the network for near crops."""
FURTHER_STEPS = 1800
"""Training steps on sweeps of heaps and of people, at most."""
BARE_WORLDS = {3: 880, 4: 110}
"""Seed and number of the worlds without objects, first for training, then for the card."""
PEOPLE_WORLDS = {5: 400, 7: 400, 6: 220}
"""Seed and number of the worlds of people in all postures, the last for the card, the others for training."""
SPARSE_WORLDS = {
    "low": (16, 1200, OF_ROBOTS),
    "people": (12, 260, FEW_BEAMS),
    "riders": (13, 240, FEW_POINTS),
}
"""Seed, number and sensors of further worlds of a kind, for training: what few beams show is mistaken most easily."""
WORN_WORLDS = {10: 220, 11: 24}
"""Seed and number of the worlds of worn sensors, first for training, then for the card."""
RIDER_WORLDS = {8: 220, 9: 60}
"""Seed and number of the roads with rows of two-wheelers, first for training, then for the card."""
STREET_WORLDS = {900_000: 44, 900_500: 44}
"""Seed and number of the simulated streets and crossings beside them."""
KITTI_DATA = (
    "106 + 2 and 53 more object frames and 4 odometry scans of KITTI (A. Geiger et al., IJRR 2013; SemanticKITTI "
    "labels, J. Behley et al., ICCV 2019), the former thinned to 32 and to 16 beams too, 3 sweeps of Argoverse 2 (B. "
    "Wilson et al., 2021) and 9 scans of PandaSet (Hesai and Scale AI, CC BY 4.0), as our segmentation cuts them up, "
    "KITTI's objects pasted into other scans and moved to other ranges, and the synthetic world, part of it with "
    "objects placed by KITTI's label files; nothing of drives 0001 and 0005"
)
SYNTHETIC_DATA = (
    "the synthetic world alone, by every simulated sensor: no recordings; the reflectance of its materials is "
    "matched to KITTI's object frames"
)
KITTI_LICENCE = "CC BY-NC-SA 3.0, as its data: not for commercial use"


def run(name: str, *arguments: str | Path | int) -> None:
    command = [sys.executable, "-m", f"tools.train.{name}", *map(str, arguments)]
    print("+", *command[1:], flush=True)
    subprocess.run(command, check=True)


def build(crops: list[Path], work: Path, out: Path, steps: int, data: str, licence: str) -> None:
    """Train a model and the network beside it for what the view cuts, with their cards.

    Args:
        crops: data sets.
        work: folder with the other data sets, of worlds without objects, of people, and near the sensor.
        out: the model.
        steps: training steps of each network.
        data: description of the data, for the card.
        licence: for the card.
    """
    run("train_pointnet", out, *crops, "--steps", steps, "--data", data, "--licence", licence)
    train_further(crops, work, out, min(steps, FURTHER_STEPS))
    train_near(crops, work, out, licence)


def further_crops(work: Path) -> None:
    """Write the crops of the further training, and of the training of the network beside a model."""
    for kind, worlds_of_seed in (
        ("bare", BARE_WORLDS),
        ("people", PEOPLE_WORLDS),
        ("riders", RIDER_WORLDS),
        ("worn", WORN_WORLDS),
        ("near", NEAR_WORLDS),
    ):
        for seed, worlds in worlds_of_seed.items():
            simulated_crops(work / f"{kind}-{seed}.npz", kind, worlds, seed)
    for kind, (seed, worlds, sensors) in SPARSE_WORLDS.items():
        simulated_crops(work / f"{kind}-{seed}.npz", kind, worlds, seed, sensors)
    for seed, worlds in STREET_WORLDS.items():
        street_crops(work / f"street-{seed}.npz", worlds, seed)


def train_further(crops: list[Path], work: Path, out: Path, steps: int, *options: str) -> None:
    """Train a model on worlds without objects and on worlds of people. Its own data sets are `crops`."""
    sparse = {kind: work / f"{kind}-{seed}.npz" for kind, (seed, _, _) in SPARSE_WORLDS.items()}
    bare = [work / f"bare-{seed}.npz" for seed in BARE_WORLDS]
    people = [sparse["low"], sparse["people"], *(work / f"people-{seed}.npz" for seed in PEOPLE_WORLDS)]
    first_riders, held_riders = (work / f"riders-{seed}.npz" for seed in RIDER_WORLDS)
    riders = [first_riders, sparse["riders"], held_riders]
    worn = [work / f"worn-{seed}.npz" for seed in WORN_WORLDS]
    streets = [work / f"street-{seed}.npz" for seed in STREET_WORLDS]
    data: list[str | Path] = ["--bare", *bare, "--people", *people, "--riders", *riders, "--worn", *worn]
    data += ["--streets", *streets, "--crops", *crops]
    run("train_further", out, *data, "--steps", steps, *options)


def train_near(crops: list[Path], work: Path, out: Path, licence: str) -> None:
    """Train the network beside a model for what the view cuts, with its card."""
    options = ["--steps", str(NEAR_STEPS), "--licence", licence]
    beside = out.with_stem(f"{out.stem}-near")
    near, held = (work / f"near-{seed}.npz" for seed in NEAR_WORLDS)
    run("train_near", out, beside, *options, "--near", near, "--held", held, "--crops", *crops)


def main() -> None:
    options = parser(__doc__)
    options.add_argument("work", type=Path, help="folder for crops")
    options.add_argument("--steps", type=int, default=24000, help="of each network (default: %(default)s)")
    options.add_argument("--kitti", type=Path, help="KITTI root, with argoverse2/ and pandaset/ beside object/")
    options.add_argument("--scans", type=Path, help="own scans: velodyne/, label_2/ and, for a camera's view, calib/")
    options.add_argument("--profile", default=profile.DEFAULT, help="of their sensor")
    options.add_argument("--further", action="store_true", help="train the shipped models on, not from scratch")
    args = options.parse_args()
    args.work.mkdir(parents=True, exist_ok=True)
    free = args.work / "synthetic.npz"
    placed = args.work / "placed.npz"
    real = args.work / "kitti.npz"
    scans = args.work / "scans.npz"
    further_crops(args.work)
    if args.kitti:
        kitti_crops(real, args.kitti)
        synthetic_crops(placed, WORLDS, args.kitti / "object" / "training_all_labels")
    if args.kitti is None or args.scans is None:
        synthetic_crops(free, WORLDS)
    if args.scans:
        own_crops(scans, args.scans, profile.load(args.profile), Path(args.profile).stem)
        crops = [scans, real, placed] if args.kitti else [scans, free]
        data = f"scans of {args.scans.name}; "
        licence = KITTI_LICENCE if args.kitti else "that of the scans"
        data += KITTI_DATA if args.kitti else SYNTHETIC_DATA
        build(crops, args.work, args.work / "pointnet-scans.onnx", args.steps, data, licence)
        return
    shipped = [([free], MODELS / "pointnet-synthetic.onnx", SYNTHETIC_DATA, "Apache-2.0: free for any use")]
    if args.kitti:
        shipped.append(([real, placed], MODELS / "pointnet-kitti.onnx", KITTI_DATA, KITTI_LICENCE))
    for crops, out, data, licence in shipped:
        if args.further:
            train_further(crops, args.work, out, FURTHER_STEPS, "--keep-boxes")
            train_near(crops, args.work, out, licence)
        else:
            build(crops, args.work, out, args.steps, data, licence)


if __name__ == "__main__":
    main()
