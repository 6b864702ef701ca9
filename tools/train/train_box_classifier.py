"""Training of the box classifier, modt.classification.box_classifier (extra [train]).

    python -m tools.train.train_box_classifier MODEL.onnx CROPS.npz...

Crops are augmented as for the PointNet, and the boxes fitted to the augmented crops. The command replaces the box
classifier of a model and keeps its network, its reflectance classifiers and the weights of the pool. The card gets a
section on the new box classifier.
"""

from __future__ import annotations

import hashlib
import re
from pathlib import Path
from typing import Any

import numpy as np
import onnx
import torch
from numpy.random import Generator
from onnx import helper

from modt.classes import CLASS_NAMES, N_CLASSES
from modt.classification.box_classifier import METADATA_KEY, Layers, from_metadata, logits, to_metadata
from modt.types import Bool, Float64, Int
from tools.options import make_torch_deterministic, parser
from tools.train.augment import augment, subsample
from tools.train.dataset import (
    BATCH_SIZE,
    FOLDS,
    SEED,
    Dataset,
    crop_features,
    dataset_features,
    draw_batch,
    load,
    sampling_pools,
)
from tools.train.held_out import HeldOut, Model, fit_pool, out_of_fold
from tools.train.network import Batch, train_mlp
from tools.train.scores import by_sensor

STEPS, AUGMENTED_BATCHES = 2000, 250
"""Steps of the training; batches that are augmented for it, since augmentation costs more than a step."""
MAX_POINTS = 400
"""Maximum number of points of a crop before augmentation."""
THRESHOLDS = (0.005, 0.01, 0.02, 0.05, 0.1)
"""Object probabilities below which the share of each class is reported."""


def train(data: Dataset, rows: Int, steps: int, seed: int) -> Layers:
    """Train on rows of the data set; uncalibrated layers that take unnormalised features."""
    torch.manual_seed(seed)
    rng = np.random.default_rng(seed)
    pools = sampling_pools(data, rows)
    drawn = [draw_batch(pools, rng) for _ in range(AUGMENTED_BATCHES)]
    feature = np.concatenate([_augmented_features(data, own, rng) for own in drawn])
    label = data.label[np.concatenate(drawn)]

    def batch() -> Batch:
        chosen = rng.integers(0, len(label), 2 * BATCH_SIZE)
        return feature[chosen], label[chosen], 0.0

    return train_mlp(batch, feature, steps, rate=1e-2, decay=1e-3)


def _augmented_features(data: Dataset, rows: Int, rng: Generator) -> Float64:
    """(R, 7) features of rows of the data set, augmented."""
    crops = subsample(data.take(rows), MAX_POINTS, rng)
    return crop_features(*augment(crops, data.sensors.take(rows), rng))


def cross_validate(data: Dataset, k: int, steps: int, seed: int) -> HeldOut:
    """Out-of-fold predictions of k folds; each is trained for these steps, with a seed of its own from `seed` on."""

    def model(among: Bool, i: int) -> Model:
        layers = train(data, np.flatnonzero(among & data.trainable), steps, seed + i)
        return lambda rows: logits(layers, dataset_features(data, rows))

    return out_of_fold(data, k, model)


def scores(held: HeldOut, network: Float64) -> dict[str, Any]:
    """Share in the pool with the network, and scores, of out-of-fold predictions and those of the PointNet (R, 4)."""
    valid, box = held.validation, held.probability
    weights, pool = fit_pool(network, box, np.zeros_like(box), valid, valid.weight)
    return {
        "weights": weights.as_dict(),
        "cross_validation": by_sensor(np.log(box), valid, valid.clear),
        "pool": by_sensor(pool, valid, valid.clear),
        "ruled_out": ruled_out(box[valid.clear], valid.label[valid.clear]),
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


def calibrated(data: Dataset, network: Float64) -> tuple[Layers, dict[str, Any]]:
    """Calibrated layers trained on all crops, and their report, of (R, 4) out-of-fold probabilities of the PointNet.

    The report holds the weights of the pool with the network, out-of-fold scores by sensor of the box alone and of
    the pool, and the share of each class below each of THRESHOLDS.
    """
    held = cross_validate(data, FOLDS, STEPS, SEED)
    return held.calibration.fold_into(train(data, np.flatnonzero(data.trainable), STEPS, SEED)), scores(held, network)


def section(data: Dataset, held: HeldOut) -> str:
    """Section of a card on a box classifier that was trained after the network."""
    valid = held.validation
    tally = np.bincount(data.label[data.trainable], minlength=N_CLASSES).tolist()
    lines = [
        "## Box classifier trained after the network\n",
        "The tables above are those of the box classifier that the network was trained with. Of this one:\n",
        f"- training: tools.train.train_box_classifier, seed {SEED}, {STEPS} steps, torch {torch.__version__}",
        f"- crops by class ({', '.join(CLASS_NAMES)}): {tally}, sha256 {', '.join(data.sha256)}",
        f"- calibration: {held.calibration.as_dict()}\n",
        "Share of each class whose object probability is below the first column, out of fold:\n",
        f"| | {' | '.join(CLASS_NAMES)} |\n|{'---|' * (1 + N_CLASSES)}",
    ]
    for row in ruled_out(held.probability[valid.clear], valid.label[valid.clear]):
        shares = (f"{100 * share:.1f} %" for share in row["share"].values())
        lines.append(f"| {row['likely']} | {' | '.join(shares)} |")
    return "\n".join([*lines, ""])


def main() -> None:
    options = parser(__doc__)
    options.add_argument("model", type=Path)
    options.add_argument("crops", type=Path, nargs="+", help="data sets of crops (.npz)")
    args = options.parse_args()
    make_torch_deterministic()
    data, model = load(*args.crops), onnx.load(str(args.model))
    metadata = {entry.key: entry.value for entry in model.metadata_props}
    held = cross_validate(data, FOLDS, STEPS, SEED)
    layers = held.calibration.fold_into(train(data, np.flatnonzero(data.trainable), STEPS, SEED))
    metadata[METADATA_KEY] = to_metadata(layers, from_metadata(metadata).weights)
    helper.set_model_props(model, metadata)
    raw = model.SerializeToString(deterministic=True)
    args.model.write_bytes(raw)
    card = args.model.with_suffix(".md")
    text = re.sub(r"sha256: \w{64}", f"sha256: {hashlib.sha256(raw).hexdigest()}", card.read_text("utf-8"), count=1)
    text = text.split("\n## Box classifier trained after")[0].rstrip("\n")
    card.write_text(f"{text}\n\n{section(data, held)}", encoding="utf-8")


if __name__ == "__main__":
    main()
