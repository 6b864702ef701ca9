"""Rebuild the models in models/ from scratch: crops, training, export, cards (extra [train]).

    python -m tools.train.build_models WORK_DIR [--kitti ROOT]

pointnet-synthetic always; pointnet-kitti where KITTI's data are given. Training takes up where it was left.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
from pathlib import Path

MODELS = Path(__file__).resolve().parents[2] / "models"
SENSOR = "hdl-64e"
"""On whose scale the crops' reflectances are."""
WORLDS, PASTES, TEACHERS = "120", "120", "2"
KITTI_DATA = (
    "106 + 2 object frames, drive 0001 (5 scans) and 4 odometry scans of KITTI (A. Geiger et al., IJRR 2013; "
    "SemanticKITTI labels, J. Behley et al., ICCV 2019) and 3 sweeps of Argoverse 2 (B. Wilson et al., 2021), as our "
    "segmentation cuts them up, what the camera of the former did not see included, their objects pasted into other "
    "scans and moved to other ranges, and the synthetic world, part of it with objects where KITTI's label files "
    "have them; nothing of drive 0005"
)
SYNTHETIC_DATA = (
    "the synthetic world alone: no recording went into it, save that its materials are as bright as what KITTI's "
    "object frames show"
)


def tool(name: str, *arguments: str | Path) -> None:
    command = [sys.executable, "-m", f"tools.train.{name}", *map(str, arguments)]
    print("+", *command[1:], flush=True)
    subprocess.run(command, check=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("work", type=Path, help="folder for crops and trained weights")
    parser.add_argument("--kitti", type=Path, help="KITTI root")
    args = parser.parse_args()
    args.work.mkdir(parents=True, exist_ok=True)
    free, placed, real = (args.work / f"{name}.npz" for name in ("synthetic", "placed", "kitti"))
    tool("build_synthetic_crops", free, "--worlds", WORLDS)
    tool("train_pointnet", args.work / "synthetic", free, "--epochs", "6", "--fold-epochs", "3", "--folds", "2")
    tool("train_boxes", args.work / "synthetic", free)
    tool("train_reflectance", args.work / "synthetic", free, "--sensor", SENSOR, "--folds", "2")
    tool("export_pointnet", args.work / "synthetic", MODELS / "pointnet-synthetic.onnx",
         "--data", SYNTHETIC_DATA, "--licence", "Apache-2.0: free for any use")  # fmt: skip
    if args.kitti:
        tool("build_crops", real, "--kitti", args.kitti, "--paste", PASTES)
        tool("build_synthetic_crops", placed, "--worlds", WORLDS,
             "--labels", args.kitti / "object" / "training_all_labels")  # fmt: skip
        tool("train_pointnet", args.work / "kitti", real, placed,
             "--epochs", "100", "--fold-epochs", "40", "--folds", "3", "--teachers", TEACHERS)  # fmt: skip
        tool("train_boxes", args.work / "kitti", real, placed)
        tool("train_reflectance", args.work / "kitti", real, placed, "--sensor", SENSOR)
        tool("export_pointnet", args.work / "kitti", MODELS / "pointnet-kitti.onnx",
             "--data", KITTI_DATA, "--licence", "CC BY-NC-SA 3.0, as its data: not for commercial use")  # fmt: skip


if __name__ == "__main__":
    main()
