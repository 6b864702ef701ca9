"""Rebuild the models in models/ from scratch: crops, training, export, cards (extra [train]).

    python -m tools.train.build_models WORK_DIR [--kitti ROOT]

Builds pointnet-synthetic, and pointnet-kitti where KITTI's data are given. Interrupted training resumes.
"""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

from tools.options import parser

MODELS = Path(__file__).resolve().parents[2] / "models"
SENSOR = "hdl-64e"
"""Sensor that measured the reflectance of the crops."""
WORLDS, PASTES, TEACHERS = "120", "120", "2"
KITTI_DATA = (
    "106 + 2 object frames, drive 0001 (5 scans) and 4 odometry scans of KITTI (A. Geiger et al., IJRR 2013; "
    "SemanticKITTI labels, J. Behley et al., ICCV 2019) and 3 sweeps of Argoverse 2 (B. Wilson et al., 2021), as our "
    "segmentation cuts them up, including the part of the former outside the camera view, their objects pasted into "
    "other scans and moved to other ranges, and the synthetic world, part of it with objects placed by KITTI's label "
    "files; nothing of drive 0005"
)
SYNTHETIC_DATA = (
    "the synthetic world alone: no recordings; the reflectance of its materials is matched to KITTI's object frames"
)


def run(name: str, *arguments: str | Path) -> None:
    command = [sys.executable, "-m", f"tools.train.{name}", *map(str, arguments)]
    print("+", *command[1:], flush=True)
    subprocess.run(command, check=True)


def main() -> None:
    options = parser(__doc__)
    options.add_argument("work", type=Path, help="folder for crops and trained weights")
    options.add_argument("--kitti", type=Path, help="KITTI root")
    args = options.parse_args()
    args.work.mkdir(parents=True, exist_ok=True)
    free, placed, real = (args.work / f"{name}.npz" for name in ("synthetic", "placed", "kitti"))
    run("build_synthetic_crops", free, "--worlds", WORLDS)
    run("train_pointnet", args.work / "synthetic", free, "--epochs", "6", "--fold-epochs", "3", "--folds", "2")
    run("train_box_classifier", args.work / "synthetic", free)
    run("train_reflectance_classifier", args.work / "synthetic", free, "--sensor", SENSOR, "--folds", "2")
    run("export_pointnet", args.work / "synthetic", MODELS / "pointnet-synthetic.onnx",
        "--data", SYNTHETIC_DATA, "--licence", "Apache-2.0: free for any use")  # fmt: skip
    if args.kitti:
        run("build_crops", real, "--kitti", args.kitti, "--paste", PASTES)
        run("build_synthetic_crops", placed, "--worlds", WORLDS,
            "--labels", args.kitti / "object" / "training_all_labels")  # fmt: skip
        run("train_pointnet", args.work / "kitti", real, placed,
            "--epochs", "100", "--fold-epochs", "40", "--folds", "3", "--teachers", TEACHERS)  # fmt: skip
        run("train_box_classifier", args.work / "kitti", real, placed)
        run("train_reflectance_classifier", args.work / "kitti", real, placed, "--sensor", SENSOR)
        run("export_pointnet", args.work / "kitti", MODELS / "pointnet-kitti.onnx",
            "--data", KITTI_DATA, "--licence", "CC BY-NC-SA 3.0, as its data: not for commercial use")  # fmt: skip


if __name__ == "__main__":
    main()
