"""Train the reflectance classifier, modt.classification.reflectance_classifier (extra [train]).

    python -m tools.train.train_reflectance OUT_DIR CROPS.npz... --sensor NAME [--steps N] [--folds K] [--seed S]

OUT_DIR holds what train_pointnet and train_boxes wrote for the same crops and folds. Writes
OUT_DIR/reflectance.npz for export_pointnet, and OUT_DIR/reflectance.json: the weights of box and reflectance
beside the network, and what box and reflectance, and all three, are worth together out of fold.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import Any

import numpy as np
import torch
from scipy.optimize import minimize
from scipy.special import softmax

from modt.classification.mlp import Layers, logits
from modt.evaluation.class_score import average_precision, confusion, top_calibration_error
from modt.types import Bool, Float64, Int
from tools.train import train_boxes
from tools.train.batches import draw, odds
from tools.train.box_features import all_described
from tools.train.dataset import Dataset, load
from tools.train.held_out import Model, cross_validated
from tools.train.mlp_training import Batch, trained
from tools.train.temperature import Calibration, fit
from tools.train.weights import load_layers, save_layers

STEPS = 1500
"""Batches."""
JITTER = 0.1
"""Of each feature in a batch, of how it is spread: few crops, seen often."""


class Described:
    """Features of all crops, as they are.

    Args:
        data: the crops.
    """

    def __init__(self, data: Dataset) -> None:
        self.box = all_described(data, np.arange(len(data)))
        self.whole = np.hstack([self.box, data.reflectance])


def train(data: Dataset, seen: Described, rows: Int, boxes: Layers, steps: int, seed: int) -> Layers:
    """Layers trained on these rows to add to what the layers of the boxes say, uncalibrated."""
    torch.manual_seed(seed)
    rng = np.random.default_rng(seed)
    pools = odds(data, rows[np.isfinite(data.reflectance[rows]).all(axis=1)])
    base = logits(boxes, seen.box)
    sample = seen.whole[np.concatenate([draw(pools, rng) for _ in range(16)])]
    scale = JITTER * sample.std(axis=0)

    def batch() -> Batch:
        chosen = np.concatenate([draw(pools, rng), draw(pools, rng)])
        feature = seen.whole[chosen]
        return Batch(feature + rng.normal(0.0, scale, feature.shape), data.label[chosen], base[chosen])

    return trained(batch, sample, steps, rate=5e-3, decay=1e-2)


def cross_validate(
    data: Dataset, seen: Described, network: Float64, k: int, steps: int, seed: int
) -> tuple[Calibration, dict[str, Any]]:
    """Out-of-fold calibration beside the boxes; the weights of a pool with the network, and what all are worth."""
    boxes: dict[int, Layers] = {}

    def boxed(among: Bool, i: int) -> Model:
        boxes[i] = train_boxes.train(data, np.flatnonzero(among & data.clear), train_boxes.STEPS, seed + i)
        return lambda rows: logits(boxes[i], seen.box[rows])

    by_box = cross_validated(data, k, boxed)

    def lit(among: Bool, i: int) -> Model:
        calibrated = [*boxes[i][:-1], by_box.calibration.folded(boxes[i][-1])]
        layers = train(data, seen, np.flatnonzero(among & data.clear), calibrated, steps, seed + i)
        return lambda rows: logits(layers, seen.whole[rows])

    added = cross_validated(data, k, lit)
    clear, label = added.clear, added.label[added.clear]
    said = np.log(by_box.probability)
    calibration = fit(added.logits[clear], label, said[clear])
    prior = calibration.apply(added.logits, said)
    evidence = added.logits / calibration.temperature + calibration.offset
    share, weight = weigh(np.log(network[clear]), said[clear], evidence[clear], label)
    alone, _ = weigh(np.log(network[clear]), said[clear], np.zeros_like(evidence[clear]), label)
    word = pooled(np.log(network), said, evidence, share, weight)
    return calibration, {
        "share": share,
        "weight": weight,
        "share_without": alone,
        "box": {
            "average_precision": average_precision(prior, added.label, added.truth),
            "ruled_out": train_boxes.ruled_out(prior[clear], label),
        },
        "network": {
            "average_precision": average_precision(word, added.label, added.truth),
            "confusion": confusion(word[clear], label),
            "ece": round(top_calibration_error(word[clear], label) or 0.0, 4),
            "log_loss": round(log_loss(word[clear], label), 4),
            "log_loss_without": round(log_loss(network[clear], label), 4),
        },
    }


def pooled(network: Float64, box: Float64, evidence: Float64, share: float, weight: float) -> Float64:
    """(R, 4) log-linear pool of what network and box say (R, 4), logarithms both, with the evidence (R, 4)."""
    probability: Float64 = softmax((1.0 - share) * network + share * box + weight * evidence, axis=1)
    return probability


def weigh(network: Float64, box: Float64, evidence: Float64, label: Int) -> tuple[float, float]:
    """The share of the box and the weight of the evidence, 0 to 1, whose pool fits the labels best."""
    found = minimize(
        lambda x: log_loss(pooled(network, box, evidence, *x), label), x0=(0.5, 0.5), bounds=((0.0, 1.0),) * 2
    )
    share, weight = found.x.tolist()
    return round(share, 2), round(weight, 2)


def log_loss(probability: Float64, label: Int) -> float:
    """Mean negative logarithm of what the true classes were given."""
    return -float(np.log(probability[np.arange(len(label)), label]).mean())


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("out", type=Path)
    parser.add_argument("crops", type=Path, nargs="+")
    parser.add_argument("--sensor", required=True, help="on whose scale the reflectances are, as profiles name it")
    parser.add_argument("--steps", type=int, default=STEPS)
    parser.add_argument("--folds", type=int, default=3)
    parser.add_argument("--seed", type=int, default=1)
    args = parser.parse_args()
    torch.set_num_threads(1)
    torch.use_deterministic_algorithms(True)
    data = load(*args.crops)
    seen = Described(data)
    with np.load(args.out / "held_out.npz") as file:
        assert file["crops"].tolist() == data.sha256, "held_out.npz is of other crops"
        network = file["probability"]
    calibration, report = cross_validate(data, seen, network, args.folds, args.steps, args.seed)
    boxes = load_layers(args.out / "boxes.npz")
    layers = train(data, seen, np.flatnonzero(data.clear), boxes, args.steps, args.seed)
    save_layers(args.out / "reflectance.npz", [*layers[:-1], calibration.folded(layers[-1])])
    report |= {"sensor": args.sensor, "steps": args.steps, "seed": args.seed}
    (args.out / "reflectance.json").write_text(json.dumps(report, indent=1) + "\n", encoding="utf-8")
    print(json.dumps(report))


if __name__ == "__main__":
    main()
