"""Train the box classifier, modt.classification.box_classifier (extra [train]).

    python -m tools.train.train_box_classifier OUT_DIR CROPS.npz... [--steps N] [--folds K] [--seed S]

Writes OUT_DIR/boxes.npz for export_pointnet and OUT_DIR/boxes.json: out-of-fold average precision and, for several
thresholds, the share of each class below the threshold. Crops are augmented as for the PointNet, and the boxes fitted
to the augmented crops.
"""

from __future__ import annotations

import json
from typing import Any

import numpy as np
import torch

from modt.classes import CLASS_NAMES, N_CLASSES
from modt.classification.mlp import Layers, logits
from modt.evaluation.class_score import average_precision
from modt.types import Bool, Float64, Int
from tools.options import make_torch_deterministic, training_parser
from tools.train.augment import augment, subsample
from tools.train.batches import draw_batch, sampling_pools
from tools.train.box_features import crop_features, dataset_features
from tools.train.dataset import Dataset, load
from tools.train.held_out import Model, out_of_fold
from tools.train.mlp_training import Batch, train_mlp
from tools.train.temperature_scaling import Calibration
from tools.train.weights import save_layers

STEPS = 1000
MAX_POINTS = 400
"""Maximum number of points of a crop before augmentation."""
THRESHOLDS = (0.005, 0.01, 0.02, 0.05, 0.1)


def train(data: Dataset, rows: Int, steps: int, seed: int) -> Layers:
    """Train on rows of the data set; uncalibrated layers that take unnormalised features."""
    torch.manual_seed(seed)
    rng = np.random.default_rng(seed)
    pools = sampling_pools(data, rows)
    sample = dataset_features(data, np.concatenate([draw_batch(pools, rng) for _ in range(16)]))

    def batch() -> Batch:
        chosen = np.concatenate([draw_batch(pools, rng), draw_batch(pools, rng)])
        crops = subsample(data.take(chosen), MAX_POINTS, rng)
        return Batch(crop_features(*augment(crops, data.sensors.take(chosen), rng)), data.label[chosen])

    return train_mlp(batch, sample, steps, rate=1e-2, decay=1e-3)


def cross_validate(data: Dataset, k: int, steps: int, seed: int) -> tuple[Calibration, dict[str, Any]]:
    """Calibration and scores from out-of-fold predictions."""

    def model(among: Bool, i: int) -> Model:
        layers = train(data, np.flatnonzero(among & data.trainable), steps, seed + i)
        return lambda rows: logits(layers, dataset_features(data, rows))

    held = out_of_fold(data, k, model)
    probability, clear = held.probability, held.unambiguous
    return held.calibration, {
        "average_precision": average_precision(probability, held.label, held.truth),
        "ruled_out": ruled_out(probability[clear], held.label[clear]),
    }


def ruled_out(probability: Float64, label: Int) -> list[dict[str, Any]]:
    """Share of each class below each threshold of the object probability, from probabilities (R, 4)."""
    return [
        {
            "likely": threshold,
            "share": dict(zip(CLASS_NAMES, _share_below(probability, label, threshold), strict=True)),
        }
        for threshold in THRESHOLDS
    ]


def _share_below(probability: Float64, label: Int, threshold: float) -> list[float]:
    below = 1.0 - probability[:, 0] < threshold
    return [round(float(below[label == c].mean()), 4) if (label == c).any() else 0.0 for c in range(N_CLASSES)]


def main() -> None:
    parser = training_parser(__doc__, folds=3)
    parser.add_argument("--steps", type=int, default=STEPS)
    args = parser.parse_args()
    make_torch_deterministic()
    data = load(*args.crops)
    args.out.mkdir(parents=True, exist_ok=True)
    calibration, report = cross_validate(data, args.folds, args.steps, args.seed)
    layers = train(data, np.flatnonzero(data.trainable), args.steps, args.seed)
    save_layers(args.out / "boxes.npz", [*layers[:-1], calibration.fold_into(layers[-1])])
    (args.out / "boxes.json").write_text(
        json.dumps(report | {"steps": args.steps, "seed": args.seed}, indent=1) + "\n", encoding="utf-8"
    )
    print(json.dumps(report))


if __name__ == "__main__":
    main()
