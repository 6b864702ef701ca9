"""Train the PointNet on a data set of crops (extra [train]).

    python -m tools.train.train_pointnet OUT_DIR CROPS.npz... [--steps N] [--folds K] [--seed S]

Writes OUT_DIR/weights.npz for export_pointnet, with the calibration folded into the last layer; OUT_DIR/report.json
with the loss curve and out-of-fold scores by sensor (tools.train.scores; folds split by drive); and
OUT_DIR/held_out.npz, the out-of-fold probabilities for the box and the reflectance classifier.
"""

from __future__ import annotations

import json
import time
from typing import Any

import numpy as np
import torch
from scipy.special import softmax

from modt.classes import ObjectClass
from modt.classification import box_classifier
from modt.classification.crops import Crops, canonical
from modt.types import Bool, Float64, Int
from tools.options import make_torch_deterministic, training_parser
from tools.train import train_box_classifier
from tools.train.augment import augment, subsample
from tools.train.batches import BATCH_SIZE, draw_batch, sampling_pools
from tools.train.box_features import dataset_features
from tools.train.dataset import Dataset, Sensors, load
from tools.train.held_out import HeldOut, Model, out_of_fold
from tools.train.network import PointNet
from tools.train.scores import by_sensor
from tools.train.weights import save_layers

POINTS, MAX_POINTS = 128, 400
"""Maximum number of points of a crop in a batch, and before augmentation."""
MIN_FREQUENCY = 1e-4
"""Stated of a class that the validation has no crop of."""
SMOOTHING = 0.02
"""Label smoothing: probability spread evenly over the classes."""
BOX_STEPS, MIN_WORTH = 600, 0.03
"""Training steps of the box classifier that tells which background is worth drawing, and its least relative share."""


def tensors(crops: Crops, sensors: Sensors) -> tuple[torch.Tensor, torch.Tensor]:
    """Input of the network: (K, 3) canonical points, crop after crop, and (R,) points of each crop."""
    local = canonical(crops, sensors.ground_z_m)
    return torch.from_numpy(local.xyz), torch.from_numpy(local.count)


def worth(data: Dataset, box: Float64, rows: Int, seed: int) -> Float64:
    """(R,) how often to draw each crop, relatively: background by how much its box is like an object's.

    The box rules most background out, and the pool with it does: what is left is what the network is asked about.

    Args:
        data: all R crops.
        box: (R, 7) features of their boxes.
        rows: to train the box classifier on.
        seed: of its training.
    """
    layers = train_box_classifier.train(data, rows, BOX_STEPS, seed)
    posterior = softmax(box_classifier.logits(layers, box), axis=1)
    like_an_object = np.maximum(1.0 - posterior[:, ObjectClass.BACKGROUND], MIN_WORTH)
    return np.where(data.label == ObjectClass.BACKGROUND, like_an_object, 1.0)


def train(data: Dataset, box: Float64, rows: Int, steps: int, seed: int) -> tuple[PointNet, list[float]]:
    """Train on rows of the data set, with (R, 7) features of boxes; the network and its loss, mean of 50 steps."""
    pools = sampling_pools(data, rows, worth(data, box, rows, seed))
    torch.manual_seed(seed)
    rng = np.random.default_rng(seed)
    net = PointNet()
    optimiser = torch.optim.AdamW(net.parameters(), weight_decay=0.02)
    schedule = torch.optim.lr_scheduler.OneCycleLR(optimiser, 3e-3, total_steps=steps, pct_start=0.15)
    criterion = torch.nn.CrossEntropyLoss(label_smoothing=SMOOTHING)
    losses: list[float] = []
    running = 0.0
    for step in range(steps):
        drawn = draw_batch(pools, rng)
        crops, sensors = augment(subsample(data.take(drawn), MAX_POINTS, rng), data.sensors.take(drawn), rng)
        loss = criterion(net(*tensors(subsample(crops, POINTS, rng), sensors)), torch.from_numpy(data.label[drawn]))
        optimiser.zero_grad()
        loss.backward()
        torch.nn.utils.clip_grad_norm_(net.parameters(), 5.0)
        optimiser.step()
        schedule.step()
        running += float(loss.detach()) / 50
        if (step + 1) % 50 == 0:
            losses.append(round(running, 4))
            running = 0.0
    return net.eval(), losses


@torch.no_grad()
def logits(net: torch.nn.Module, data: Dataset, rows: Int) -> Float64:
    """(R, 4) of rows of the data set, without augmentation."""
    rng = np.random.default_rng(0)
    parts = np.split(rows, np.arange(BATCH_SIZE, len(rows), BATCH_SIZE))
    out: Float64 = (
        torch.cat([net(*tensors(subsample(data.take(p), POINTS, rng), data.sensors.take(p))) for p in parts])
        .double()
        .numpy()
    )
    return out


def cross_validate(data: Dataset, box: Float64, k: int, steps: int, seed: int) -> tuple[HeldOut, dict[str, Any]]:
    """Out-of-fold predictions and their scores by sensor."""

    def model(among: Bool, i: int) -> Model:
        net, _ = train(data, box, np.flatnonzero(among & data.trainable), steps, seed + i)
        return lambda rows: logits(net, data, rows)

    held = out_of_fold(data, k, model)
    return held, by_sensor(np.log(held.probability), held.validation, held.validation.clear)


def main() -> None:
    parser = training_parser(__doc__)
    parser.add_argument("--steps", type=int, default=24000, help="of each network (default: %(default)s)")
    args = parser.parse_args()
    make_torch_deterministic()
    data = load(*args.crops)
    args.out.mkdir(parents=True, exist_ok=True)
    started = time.process_time()
    box = dataset_features(data, np.arange(len(data)))
    report: dict[str, Any] = {"seed": args.seed, "steps": args.steps}
    report |= {"crops_sha256": data.sha256, "provenance": data.provenance, "torch": torch.__version__}
    held, report["cross_validation"] = cross_validate(data, box, args.folds, args.steps, args.seed)
    calibration = held.calibration
    report["class_frequency"] = held.validation.class_frequency.clip(MIN_FREQUENCY).round(4).tolist()
    np.savez(args.out / "held_out.npz", probability=held.probability, crops=data.sha256)
    print(json.dumps(report["cross_validation"]))
    net, losses = train(data, box, np.flatnonzero(data.trainable), args.steps, args.seed)
    report |= {"loss": losses, "calibration": calibration.as_dict(), "cpu_s": round(time.process_time() - started)}
    layers = net.layers()
    layers[-1] = calibration.fold_into(layers[-1])
    save_layers(args.out / "weights.npz", layers)
    (args.out / "report.json").write_text(json.dumps(report, indent=1) + "\n", encoding="utf-8")
    print(json.dumps({"loss": losses[-1:], "cpu_s": report["cpu_s"]}))


if __name__ == "__main__":
    main()
