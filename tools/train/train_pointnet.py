"""Train a model on data sets of crops: PointNet, box and reflectance classifiers (extra [train]).

    python -m tools.train.train_pointnet MODEL.onnx CROPS.npz... --data TEXT --licence TEXT [--steps N]

Writes the model, with all three calibrated, and beside it a card with out-of-fold scores by sensor
(modt_training.scores; folds split by drive).
"""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any

import numpy as np
import torch
from scipy.special import softmax

from modt.classes import ObjectClass
from modt.classification import box_classifier
from modt.config import REFLECTANCE_SCALES
from modt.types import Bool, Float64, Int
from modt_training import train_box_classifier
from modt_training.augment import augment, subsample
from modt_training.dataset import (
    BATCH_SIZE,
    FOLDS,
    SEED,
    Dataset,
    Pools,
    dataset_features,
    draw_batch,
    load,
    sampling_pools,
)
from modt_training.export_pointnet import export
from modt_training.fine_tuning import MAX_POINTS, POINTS, tensors
from modt_training.held_out import LogitsOfRows, out_of_fold
from modt_training.network import PointNet
from modt_training.scores import by_sensor
from tools.options import make_torch_deterministic, parser
from tools.train import train_reflectance_classifier

MIN_FREQUENCY = 1e-4
"""Frequency stated for a class without a crop in the validation."""
PRINTED_STEPS = 1000
"""Steps between two printed losses."""
SMOOTHING = 0.02
"""Label smoothing: probability spread evenly over the classes."""
BOX_STEPS = 600
"""Training steps of the box classifier that rates how often to draw background."""
MIN_WORTH = 0.03
"""Least relative rate at which background is drawn."""


def worth(data: Dataset, box: Float64, rows: Int, seed: int) -> Float64:
    """(R,) relative frequency with which to draw each crop, for background by the likeness of its box to an object's.

    The pool with the box rules most background out, and the network judges only the rest.

    Args:
        data: all R crops.
        box: (R, 7) features of their boxes.
        rows: to train the box classifier on.
        seed: seed of its training.
    """
    layers = train_box_classifier.train(data, rows, BOX_STEPS, seed)
    posterior = softmax(box_classifier.logits(layers, box), axis=1)
    like_an_object = np.maximum(1.0 - posterior[:, ObjectClass.BACKGROUND], MIN_WORTH)
    return np.where(data.label == ObjectClass.BACKGROUND, like_an_object, 1.0)


def batch_loss(
    net: torch.nn.Module, data: Dataset, pools: Pools, rng: np.random.Generator, smoothing: float = 0.0
) -> torch.Tensor:
    """Loss of a network on a batch of augmented crops."""
    drawn = draw_batch(pools, rng)
    crops, sensors = augment(subsample(data.take(drawn), MAX_POINTS, rng), data.sensors.take(drawn), rng)
    scores = net(*tensors(subsample(crops, POINTS, rng), sensors))
    label = torch.from_numpy(data.label[drawn])
    return torch.nn.functional.cross_entropy(scores, label, label_smoothing=smoothing)


def train(data: Dataset, box: Float64, rows: Int, steps: int, seed: int) -> PointNet:
    """Train on rows of the data set, with (R, 7) features of boxes; prints the loss now and then."""
    pools = sampling_pools(data, rows, worth(data, box, rows, seed))
    torch.manual_seed(seed)
    rng = np.random.default_rng(seed)
    net = PointNet()
    optimiser = torch.optim.AdamW(net.parameters(), weight_decay=0.02)
    schedule = torch.optim.lr_scheduler.OneCycleLR(optimiser, 3e-3, total_steps=steps, pct_start=0.15)
    for step in range(steps):
        loss = batch_loss(net, data, pools, rng, SMOOTHING)
        optimiser.zero_grad()
        loss.backward()
        torch.nn.utils.clip_grad_norm_(net.parameters(), 5.0)
        optimiser.step()
        schedule.step()
        if (step + 1) % PRINTED_STEPS == 0:
            print(step + 1, round(loss.item(), 4), flush=True)
    return net.eval()


@torch.no_grad()
def logits(net: torch.nn.Module, data: Dataset, rows: Int) -> Float64:
    """(R, C) logits of rows of the data set, without augmentation."""
    rng = np.random.default_rng(0)
    parts = np.split(rows, np.arange(BATCH_SIZE, len(rows), BATCH_SIZE))
    out: Float64 = (
        torch.cat([net(*tensors(subsample(data.take(p), POINTS, rng), data.sensors.take(p))) for p in parts])
        .double()
        .numpy()
    )
    return out


def main() -> None:
    options = parser(__doc__)
    options.add_argument("out", type=Path, help="model to write (.onnx), with its card beside it (.md)")
    options.add_argument("crops", type=Path, nargs="+", help="data sets of crops (.npz)")
    options.add_argument("--data", required=True, help="description of the training data, for the card")
    options.add_argument("--licence", required=True)
    options.add_argument("--steps", type=int, default=24000, help="of each network (default: %(default)s)")
    args = options.parse_args()
    make_torch_deterministic()
    data = load(*args.crops)
    started = time.process_time()
    box = dataset_features(data, np.arange(len(data)))

    def fold_model(among: Bool, i: int) -> LogitsOfRows:
        net = train(data, box, np.flatnonzero(among & data.trainable), args.steps, SEED + i)
        return lambda rows: logits(net, data, rows)

    held = out_of_fold(data, FOLDS, fold_model)
    valid = held.validation
    net = train(data, box, np.flatnonzero(data.trainable), args.steps, SEED)
    report: dict[str, Any] = {"seed": SEED, "steps": args.steps, "cpu_s": round(time.process_time() - started)}
    report |= {"crops_sha256": data.sha256, "provenance": data.provenance, "torch": torch.__version__}
    report |= {"calibration": held.calibration.as_dict()}
    report |= {"class_frequency": valid.class_frequency.clip(MIN_FREQUENCY).round(4).tolist()}
    report |= {"cross_validation": by_sensor(np.log(held.probability), valid, valid.clear)}
    boxes, report["boxes"] = train_box_classifier.calibrated(data, held.probability)
    each = (
        train_reflectance_classifier.calibrated(data, sensor, held.probability, boxes)
        for sensor in sorted(REFLECTANCE_SCALES)
    )
    trained = [pair for pair in each if pair]
    reflectance = [layers for layers, _ in trained]
    report["reflectance"] = [facts for _, facts in trained]
    layers = held.calibration.fold_into(net.layers())
    export(args.out, layers, boxes, reflectance, report, args.data, args.licence)


if __name__ == "__main__":
    main()
