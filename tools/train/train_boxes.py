"""Train what a model thinks of a proposal by its box alone, modt.classification.prior, on its crops (extra [train]).

    python -m tools.train.train_boxes OUT_DIR CROPS.npz... [--steps N] [--folds K] [--seed S]

Writes OUT_DIR/boxes.npz for export_pointnet, and OUT_DIR/boxes.json: out-of-fold average precision and, for
some thresholds, the share of the background that its box rules out and the share of the objects ruled out with it.
The boxes are fitted anew to crops augmented as those of the network are.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import Any

import numpy as np
import torch

from modt.classes import CLASS_NAMES, N_CLASSES
from modt.classification.mlp import Layers, logits
from modt.evaluation.class_score import average_precision
from modt.types import Bool, Float64, Int
from tools.train.augment import Beams, augment, limit
from tools.train.batches import draw, odds
from tools.train.box_features import all_described, described
from tools.train.dataset import Dataset, load
from tools.train.held_out import Model, cross_validated
from tools.train.mlp_training import Batch, trained
from tools.train.temperature import Calibration
from tools.train.weights import save_layers

STEPS = 1000
AUGMENTED_POINTS = 400
"""Points of a crop that are augmented at most."""
THRESHOLDS = (0.005, 0.01, 0.02, 0.05, 0.1)


def train(data: Dataset, rows: Int, steps: int, seed: int) -> Layers:
    """Layers trained on these rows, uncalibrated; they take features as they are."""
    torch.manual_seed(seed)
    rng = np.random.default_rng(seed)
    pools = odds(data, rows)
    sample = all_described(data, np.concatenate([draw(pools, rng) for _ in range(16)]))

    def batch() -> Batch:
        chosen = np.concatenate([draw(pools, rng), draw(pools, rng)])
        seen = augment(limit(data.take(chosen), AUGMENTED_POINTS, rng), Beams(), rng)
        return Batch(described(seen), data.label[chosen])

    return trained(batch, sample, steps, rate=1e-2, decay=1e-3)


def cross_validate(data: Dataset, k: int, steps: int, seed: int) -> tuple[Calibration, dict[str, Any]]:
    """Out-of-fold calibration, and what a threshold saves and costs."""

    def model(among: Bool, i: int) -> Model:
        layers = train(data, np.flatnonzero(among & data.clear), steps, seed + i)
        return lambda rows: logits(layers, all_described(data, rows))

    held = cross_validated(data, k, model)
    probability, clear = held.probability, held.clear
    return held.calibration, {
        "average_precision": average_precision(probability, held.label, held.truth),
        "ruled_out": ruled_out(probability[clear], held.label[clear]),
    }


def ruled_out(probability: Float64, label: Int) -> list[dict[str, Any]]:
    """Share of each class that thresholds of what is thought of them (R, 4) rule out."""
    return [
        {"likely": threshold, "share": dict(zip(CLASS_NAMES, _below(probability, label, threshold), strict=True))}
        for threshold in THRESHOLDS
    ]


def _below(probability: Float64, label: Int, threshold: float) -> list[float]:
    """Share of each class that is an object with less than this probability."""
    out = 1.0 - probability[:, 0] < threshold
    return [round(float(out[label == c].mean()), 4) if (label == c).any() else 0.0 for c in range(N_CLASSES)]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("out", type=Path)
    parser.add_argument("crops", type=Path, nargs="+")
    parser.add_argument("--steps", type=int, default=STEPS)
    parser.add_argument("--folds", type=int, default=3)
    parser.add_argument("--seed", type=int, default=1)
    args = parser.parse_args()
    torch.set_num_threads(1)
    torch.use_deterministic_algorithms(True)
    data = load(*args.crops)
    args.out.mkdir(parents=True, exist_ok=True)
    calibration, report = cross_validate(data, args.folds, args.steps, args.seed)
    layers = train(data, np.flatnonzero(data.clear), args.steps, args.seed)
    layers = [*layers[:-1], calibration.folded(layers[-1])]
    save_layers(args.out / "boxes.npz", layers)
    (args.out / "boxes.json").write_text(
        json.dumps(report | {"steps": args.steps, "seed": args.seed}, indent=1) + "\n", encoding="utf-8"
    )
    print(json.dumps(report))


if __name__ == "__main__":
    main()
