"""Train what a model thinks of a proposal by its box alone, modt.classification.prior, on its crops (extra [train]).

    train_boxes.py OUT_DIR CROPS.npz... [--steps N] [--folds K] [--seed S]

Writes OUT_DIR/boxes.npz for tools/export_pointnet.py, and OUT_DIR/boxes.json: out-of-fold average precision and, for
some thresholds, the share of the background that its box rules out and the share of the objects ruled out with it.
The boxes are fitted anew to crops augmented as those of the network are.
"""

from __future__ import annotations

import argparse
import json
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import nn

from augment import Beams, augment, limit
from calibration import Calibration
from crop_boxes import all_described, described
from dataset import Dataset, load
from held_out import Model, cross_validated
from modt.classification.prior import N_FEATURES, Layers, logits
from modt.types import CLASS_NAMES, N_CLASSES, Bool, Float64, Int
from network import save_layers
from scores import average_precision
from train_pointnet import draw, odds

WIDTHS = (N_FEATURES, 32, 32, N_CLASSES)
AUGMENTED_POINTS = 400
"""Points of a crop that are augmented at most."""
THRESHOLDS = (0.005, 0.01, 0.02, 0.05, 0.1)


def train(data: Dataset, rows: Int, steps: int, seed: int) -> Layers:
    """Layers trained on these rows, uncalibrated; they take features as they are."""
    torch.manual_seed(seed)
    rng = np.random.default_rng(seed)
    pools = odds(data, rows)
    sample = all_described(data, np.concatenate([draw(pools, rng) for _ in range(16)]))
    mean, scale = sample.mean(axis=0), sample.std(axis=0)
    linear = [nn.Linear(a, b) for a, b in pairwise(WIDTHS)]
    net = nn.Sequential(*[part for layer in linear for part in (layer, nn.Tanh())][:-1])
    optimiser = torch.optim.AdamW(net.parameters(), weight_decay=1e-3)
    schedule = torch.optim.lr_scheduler.OneCycleLR(optimiser, 1e-2, total_steps=steps)
    criterion = nn.CrossEntropyLoss()
    for _ in range(steps):
        chosen = np.concatenate([draw(pools, rng), draw(pools, rng)])
        seen = augment(limit(data.take(chosen), AUGMENTED_POINTS, rng), Beams(), rng)
        feature = torch.from_numpy(((described(seen) - mean) / scale).astype(np.float32))
        loss = criterion(net(feature), torch.from_numpy(data.label[chosen]))
        optimiser.zero_grad()
        loss.backward()
        optimiser.step()
        schedule.step()
    layers = [(p.weight.detach().double().numpy().T, p.bias.detach().double().numpy()) for p in linear]
    weight, bias = layers[0]
    weight = weight / scale[:, None]
    return [(weight, bias - mean @ weight), *layers[1:]]


def cross_validate(data: Dataset, k: int, steps: int, seed: int) -> tuple[Calibration, dict[str, Any]]:
    """Out-of-fold calibration, and what a threshold saves and costs."""

    def trained(among: Bool, i: int) -> Model:
        layers = train(data, np.flatnonzero(among & data.clear), steps, seed + i)
        return lambda rows: logits(layers, all_described(data, rows))

    held = cross_validated(data, k, trained)
    probability, clear = held.probability, held.clear
    shares = [_below(probability[clear], held.label[clear], threshold) for threshold in THRESHOLDS]
    return held.calibration, {
        "average_precision": average_precision(probability, held.label, held.truth),
        "ruled_out": [
            {"likely": threshold, "share": dict(zip(CLASS_NAMES, share, strict=True))}
            for threshold, share in zip(THRESHOLDS, shares, strict=True)
        ],
    }


def _below(probability: Float64, label: Int, threshold: float) -> list[float]:
    """Share of each class that is an object with less than this probability."""
    out = 1.0 - probability[:, 0] < threshold
    return [round(float(out[label == c].mean()), 4) if (label == c).any() else 0.0 for c in range(N_CLASSES)]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("out", type=Path)
    parser.add_argument("crops", type=Path, nargs="+")
    parser.add_argument("--steps", type=int, default=1000)
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
