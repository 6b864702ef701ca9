"""Train the reflectance classifier, modt.classification.reflectance_classifier (extra [train]).

    python -m tools.train.train_reflectance_classifier OUT_DIR CROPS.npz... --sensor NAME
                                    [--steps N] [--folds K] [--seed S]

OUT_DIR holds the output of train_pointnet and train_box_classifier for the same crops and folds. Writes
OUT_DIR/reflectance.npz for export_pointnet and OUT_DIR/reflectance.json: the weights of box and reflectance in the
pool with the network, and out-of-fold scores of box with reflectance and of all three.
"""

from __future__ import annotations

import json
from typing import Any

import numpy as np
import torch
from scipy.optimize import minimize
from scipy.special import softmax

from modt.classification.mlp import Layers, logits
from modt.evaluation.class_score import average_precision, confusion, top_calibration_error
from modt.types import Bool, Float64, Int
from tools.options import make_torch_deterministic, training_parser
from tools.train import train_box_classifier
from tools.train.batches import draw_batch, sampling_pools
from tools.train.box_features import dataset_features
from tools.train.dataset import Dataset, load
from tools.train.held_out import Model, out_of_fold
from tools.train.mlp_training import Batch, train_mlp
from tools.train.temperature_scaling import Calibration, fit_calibration
from tools.train.weights import load_layers, save_layers

STEPS = 1500
JITTER = 0.1
"""Noise added to the features of a batch, as a fraction of their standard deviation; few crops are drawn often."""


class Features:
    """Features of all crops of a data set, without augmentation.

    Attributes:
        box: (R, 7) of the boxes.
        all: (R, 12) of box and reflectance.
    """

    def __init__(self, data: Dataset) -> None:
        self.box = dataset_features(data, np.arange(len(data)))
        self.all = np.hstack([self.box, data.reflectance])


def train(data: Dataset, features: Features, rows: Int, boxes: Layers, steps: int, seed: int) -> Layers:
    """Train on rows of the data set; uncalibrated layers whose logits are added to those of the box layers."""
    torch.manual_seed(seed)
    rng = np.random.default_rng(seed)
    pools = sampling_pools(data, rows[np.isfinite(data.reflectance[rows]).all(axis=1)])
    base = logits(boxes, features.box)
    sample = features.all[np.concatenate([draw_batch(pools, rng) for _ in range(16)])]
    scale = JITTER * sample.std(axis=0)

    def batch() -> Batch:
        chosen = np.concatenate([draw_batch(pools, rng), draw_batch(pools, rng)])
        feature = features.all[chosen]
        return Batch(feature + rng.normal(0.0, scale, feature.shape), data.label[chosen], base[chosen])

    return train_mlp(batch, sample, steps, rate=5e-3, decay=1e-2)


def cross_validate(
    data: Dataset, features: Features, network: Float64, k: int, steps: int, seed: int
) -> tuple[Calibration, dict[str, Any]]:
    """Calibration, pool weights and scores from out-of-fold predictions.

    Args:
        data: all crops.
        features: of them.
        network: (R, 4) out-of-fold probabilities of the PointNet.
        k: number of folds.
        steps: training steps of a fold.
        seed: of the first fold.
    """
    boxes: dict[int, Layers] = {}

    def box_model(among: Bool, i: int) -> Model:
        layers = train_box_classifier.train(
            data, np.flatnonzero(among & data.trainable), train_box_classifier.STEPS, seed + i
        )
        boxes[i] = layers
        return lambda rows: logits(layers, features.box[rows])

    by_box = out_of_fold(data, k, box_model)

    def reflectance_model(among: Bool, i: int) -> Model:
        calibrated = [*boxes[i][:-1], by_box.calibration.fold_into(boxes[i][-1])]
        layers = train(data, features, np.flatnonzero(among & data.trainable), calibrated, steps, seed + i)
        return lambda rows: logits(layers, features.all[rows])

    held = out_of_fold(data, k, reflectance_model)
    clear, label = held.unambiguous, held.label[held.unambiguous]
    box = np.log(by_box.probability)
    calibration = fit_calibration(held.logits[clear], label, box[clear])
    both = calibration.apply(held.logits, box)
    evidence = held.logits / calibration.temperature + calibration.offset
    share, weight = fit_pool(np.log(network[clear]), box[clear], evidence[clear], label)
    share_without, _ = fit_pool(np.log(network[clear]), box[clear], np.zeros_like(evidence[clear]), label)
    pool = pooled(np.log(network), box, evidence, share, weight)
    return calibration, {
        "share": share,
        "weight": weight,
        "share_without": share_without,
        "box": {
            "average_precision": average_precision(both, held.label, held.truth),
            "ruled_out": train_box_classifier.ruled_out(both[clear], label),
        },
        "network": {
            "average_precision": average_precision(pool, held.label, held.truth),
            "confusion": confusion(pool[clear], label),
            "ece": top_calibration_error(pool[clear], label),
            "log_loss": round(log_loss(pool[clear], label), 4),
            "log_loss_without": round(log_loss(network[clear], label), 4),
        },
    }


def pooled(network: Float64, box: Float64, evidence: Float64, share: float, weight: float) -> Float64:
    """(R, 4) log-linear pool of the log probabilities (R, 4) of network and box and the evidence (R, 4)."""
    probability: Float64 = softmax((1.0 - share) * network + share * box + weight * evidence, axis=1)
    return probability


def fit_pool(network: Float64, box: Float64, evidence: Float64, label: Int) -> tuple[float, float]:
    """Share of the box and weight of the evidence, both in 0 to 1, that minimise the log loss of the pool."""

    def loss(x: Float64) -> float:
        return log_loss(pooled(network, box, evidence, float(x[0]), float(x[1])), label)

    share, weight = minimize(loss, x0=(0.5, 0.5), bounds=((0.0, 1.0),) * 2).x.tolist()
    return round(share, 2), round(weight, 2)


def log_loss(probability: Float64, label: Int) -> float:
    """Mean negative log probability of the true classes."""
    return -float(np.log(probability[np.arange(len(label)), label]).mean())


def main() -> None:
    parser = training_parser(__doc__, folds=3)
    parser.add_argument("--sensor", required=True, help="sensor that measured the reflectance, by its profile's name")
    parser.add_argument("--steps", type=int, default=STEPS)
    args = parser.parse_args()
    make_torch_deterministic()
    data = load(*args.crops)
    features = Features(data)
    with np.load(args.out / "held_out.npz") as file:
        assert file["crops"].tolist() == data.sha256, "held_out.npz belongs to other crops"
        network = file["probability"]
    calibration, report = cross_validate(data, features, network, args.folds, args.steps, args.seed)
    boxes = load_layers(args.out / "boxes.npz")
    layers = train(data, features, np.flatnonzero(data.trainable), boxes, args.steps, args.seed)
    save_layers(args.out / "reflectance.npz", [*layers[:-1], calibration.fold_into(layers[-1])])
    report |= {"sensor": args.sensor, "steps": args.steps, "seed": args.seed}
    (args.out / "reflectance.json").write_text(json.dumps(report, indent=1) + "\n", encoding="utf-8")
    print(json.dumps(report))


if __name__ == "__main__":
    main()
