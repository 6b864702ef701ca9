"""Train and export the networks of the paper's experiments (extra [train]).

    python -m tools.train.train_textbook MODELS_DIR CROPS.npz

Writes pointnet-paper-40 and pointnet-paper, the network of section V-A after 40 and after 100 epochs of one training.
They are networks alone, without calibration, class frequency or box classifier. One drive in five is held out; the
card has its scores. An epoch is as many crops as the scans show under the default segmentation, drawn by class among
all.
"""

from __future__ import annotations

import hashlib
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import torch
from scipy.special import softmax

from modt.classes import CLASS_NAMES
from modt_evaluation.class_score import average_precision
from modt_training.dataset import BATCH_SIZE, REAL, SEED, Dataset, folds, load, sampling_pools
from modt_training.export_pointnet import graph
from modt_training.held_out import Validation
from modt_training.network import PointNet
from tools.options import make_torch_deterministic, parser
from tools.train.build_models import KITTI_LICENCE
from tools.train.train_pointnet import batch_loss, logits

EPOCHS = {40: "pointnet-paper-40", 100: "pointnet-paper"}
FOLDS = 5
HELD_OUT = 4
RATE = 1e-3
"""Learning rate of Adam at the start; this and the next two are those of PointNet's authors."""
DECAY = 0.7
"""Factor on the learning rate at each decay."""
DECAY_EPOCHS = 20
"""Epochs between two decays."""


def crops_of_epoch(data: Dataset) -> int:
    """Number of crops that the scans show, those of one epoch."""
    return int((data.trainable & (data.variant == REAL)).sum())


def trained(net: PointNet, data: Dataset, epochs: int) -> Iterator[tuple[int, float]]:
    """Train a network; yields the epochs done, and the mean loss of the last one."""
    rng = np.random.default_rng(SEED)
    fold = folds(data, FOLDS)
    pools = sampling_pools(data, np.flatnonzero(data.trainable & (fold[data.drive] != HELD_OUT)))
    optimiser = torch.optim.Adam(net.parameters(), RATE)
    schedule = torch.optim.lr_scheduler.StepLR(optimiser, DECAY_EPOCHS, DECAY)
    steps = -(-crops_of_epoch(data) // BATCH_SIZE)
    for epoch in range(1, epochs + 1):
        total = 0.0
        for _ in range(steps):
            loss = batch_loss(net.train(), data, pools, rng)
            optimiser.zero_grad()
            loss.backward()
            optimiser.step()
            total += float(loss.detach())
        schedule.step()
        yield epoch, total / steps


def held_out_scores(net: PointNet, data: Dataset) -> dict[str, tuple[list[int], dict[str, float]]]:
    """Objects and average precision by class, by sensor, of the drives that are held out."""
    valid = Validation.of(data)
    fold = folds(data, FOLDS)
    rows = np.flatnonzero(fold[data.drive[valid.rows]] == HELD_OUT)
    probability = softmax(logits(net.eval(), data, valid.rows[rows]), axis=1)
    scores = {}
    for s in np.unique(valid.sensor[rows]).tolist():
        of_sensor = valid.sensor[rows] == s
        truth = valid.truth
        objects = truth.label[(truth.sensor == s) & (fold[truth.drive] == HELD_OUT)]
        number = np.bincount(objects, minlength=len(CLASS_NAMES))
        precision = average_precision(probability[of_sensor], valid.label[rows][of_sensor], number)
        scores[valid.sensor_names[s]] = number[1:].tolist(), precision
    return scores


def card(name: str, model: bytes, facts: dict[str, Any]) -> str:
    """Model card in Markdown."""
    rows = []
    for sensor, (objects, precision) in facts["scores"].items():
        ap = " / ".join(f"{100 * precision[c]:.0f}" for c in CLASS_NAMES[1:])
        rows.append(f"| {sensor} | {' / '.join(map(str, objects))} | {ap} |")
    return "\n".join(
        [
            f"# {name}",
            "",
            "PointNet of section V-A of the paper (400 x 3; 32, 64, 512 shared; maximum; 256, 128, 4), in the "
            "textbook order, ONNX, weights in half precision.",
            "For the paper's experiments (profile `paper`): the network alone, not calibrated, no box classifier.",
            "",
            f"- sha256: {hashlib.sha256(model).hexdigest()}",
            f"- licence: {KITTI_LICENCE}",
            f"- classes: {', '.join(CLASS_NAMES)}",
            "- input and output: as pointnet-kitti",
            f"- data: crops {', '.join(facts['sha256'])} (see the card of pointnet-kitti), one drive in {FOLDS} held "
            "out; nothing of drive 0005",
            f"- training: tools.train.train_textbook, seed {SEED}, {facts['epochs']} epochs of "
            f"{facts['crops']} crops drawn by class, loss {facts['loss']:.3f}, torch {torch.__version__}, "
            f"{facts['cpu_s']} s on one core",
            "",
            "## Drives held out, by sensor",
            "",
            "| sensor | objects car / pedestrian / cyclist | AP [%] |",
            "|---|---|---|",
            *rows,
            "",
        ]
    )


def main() -> None:
    options = parser(__doc__)
    options.add_argument("out", type=Path, help="folder of the models")
    options.add_argument("data", type=Path, help="data set of crops (.npz)")
    args = options.parse_args()
    make_torch_deterministic()
    torch.manual_seed(SEED)
    data = load(args.data)
    started = time.process_time()
    net = PointNet()
    for epoch, loss in trained(net, data, max(EPOCHS)):
        print(epoch, round(loss, 4), round(time.process_time() - started), flush=True)
        if epoch not in EPOCHS:
            continue
        facts = {"epochs": epoch, "loss": loss, "crops": crops_of_epoch(data), "sha256": data.sha256}
        facts |= {"cpu_s": round(time.process_time() - started), "scores": held_out_scores(net, data)}
        network = graph(net.eval().layers(), pool_first=False, half=True)
        model = network.SerializeToString(deterministic=True)
        out = args.out / f"{EPOCHS[epoch]}.onnx"
        out.write_bytes(model)
        out.with_suffix(".md").write_text(card(out.stem, model, facts), encoding="utf-8")


if __name__ == "__main__":
    main()
