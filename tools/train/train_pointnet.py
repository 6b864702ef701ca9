"""Train the PointNet on a data set of crops; seeded and resumable (extra [train]).

    python -m tools.train.train_pointnet OUT_DIR CROPS.npz... [--steps N] [--folds K] [--teachers T] [--seed S]

Writes OUT_DIR/weights.npz for export_pointnet and OUT_DIR/report.json with the loss curve. With --folds the report
has out-of-fold average precision, confusion and calibration (folds split by drive), OUT_DIR/held_out.npz has the
out-of-fold probabilities for train_reflectance_classifier, and the calibration is folded into the last layer. With
--teachers an ensemble of T networks, trained as long as those of the folds, provides the targets
(tools.train.distillation), with the reflectance evidence of train_reflectance_classifier for unlabelled crops.
"""

from __future__ import annotations

import json
import time
from pathlib import Path
from typing import Any

import numpy as np
import torch

from modt.classes import N_CLASSES
from modt.classification.crops import Crops, canonical
from modt.classification.mlp import logits as layer_logits
from modt.types import Bool, Float64, Int
from tools.options import make_torch_deterministic, training_parser
from tools.train import train_box_classifier, train_reflectance_classifier
from tools.train.augment import augment, subsample
from tools.train.batches import BATCH_SIZE, draw_batch, sampling_pools
from tools.train.dataset import UNLABELLED, Dataset, Sensors, load
from tools.train.distillation import EnsembleTargets, LabelTargets, TargetSource
from tools.train.held_out import HeldOut, Model, out_of_fold
from tools.train.network import PointNet
from tools.train.scores import by_sensor
from tools.train.temperature_scaling import Calibration
from tools.train.weights import save_layers

POINTS, MAX_POINTS = 128, 400
"""Maximum number of points of a crop in a batch, and before augmentation."""
UNLABELLED_BATCH_SIZE = 102
"""Unlabelled crops of a step, with teachers."""


def tensors(crops: Crops, sensors: Sensors) -> tuple[torch.Tensor, torch.Tensor]:
    """Input of the network: (K, 3) canonical points, crop after crop, and (R,) points of each crop."""
    local = canonical(crops, sensors.height_m)
    return torch.from_numpy(local.xyz), torch.from_numpy(local.count)


def train(
    data: Dataset, trainable: Int, steps: int, seed: int, state: Path | None, source: TargetSource
) -> tuple[PointNet, list[float]]:
    """Train on rows `trainable`, resuming from the file `state`; the network and its loss, mean of 50 steps."""
    torch.manual_seed(seed)
    rng = np.random.default_rng(seed)
    net = PointNet()
    optimiser = torch.optim.AdamW(net.parameters(), weight_decay=0.02)
    schedule = torch.optim.lr_scheduler.OneCycleLR(optimiser, 3e-3, total_steps=steps, pct_start=0.15)
    criterion = torch.nn.CrossEntropyLoss()
    pools = sampling_pools(data, trainable)
    losses: list[float] = []
    first = 0
    if state is not None and state.exists():
        saved = torch.load(state, weights_only=False)
        net.load_state_dict(saved["net"])
        optimiser.load_state_dict(saved["optimiser"])
        schedule.load_state_dict(saved["schedule"])
        torch.set_rng_state(saved["torch"])
        rng.bit_generator.state = saved["numpy"]
        losses, first = saved["losses"], saved["step"]
    running = 0.0
    for step in range(first, steps):
        labelled = draw_batch(pools, rng)
        unlabelled = source.draw_unlabelled(rng)
        rows = np.append(labelled, unlabelled)
        crops, sensors = augment(subsample(data.take(rows), MAX_POINTS, rng), data.sensors.take(rows), rng)
        batch = tensors(subsample(crops, POINTS, rng), sensors)
        loss = criterion(net(*batch), source.targets(*batch, data.label[labelled], unlabelled))
        optimiser.zero_grad()
        loss.backward()
        torch.nn.utils.clip_grad_norm_(net.parameters(), 5.0)
        optimiser.step()
        schedule.step()
        running += float(loss.detach()) / 50
        if (step + 1) % 50 == 0:
            losses.append(round(running, 4))
            running = 0.0
        if state is not None and ((step + 1) % 200 == 0 or step + 1 == steps):
            saved = {"net": net.state_dict(), "optimiser": optimiser.state_dict(), "schedule": schedule.state_dict()}
            saved |= {"torch": torch.get_rng_state(), "numpy": rng.bit_generator.state}
            torch.save(saved | {"losses": losses, "step": step + 1}, state)
    return net.eval(), losses


def train_with_teachers(
    data: Dataset, among: Bool, steps: tuple[int, int], teachers: int, seed: int, folder: Path | None
) -> tuple[PointNet, list[float]]:
    """Train the teachers, if any, then the network on their targets; the network and its loss curve.

    Args:
        data: all crops.
        among: (R,) rows available for training, the teachers' included.
        steps: of the network, and of each teacher.
        teachers: number of teachers; the targets are the labels without any.
        seed: of the network; those of the teachers are derived from it.
        folder: for files of the training state.
    """
    rows = np.flatnonzero(among & data.trainable)
    states = [folder / f"teacher{t}.pt" if folder else None for t in range(teachers)]
    ensemble = [
        train(data, rows, steps[1], seed + 100 * t, s, LabelTargets())[0] for t, s in enumerate(states, start=1)
    ]
    unlabelled = np.flatnonzero(among & (data.variant == UNLABELLED))
    source: TargetSource = LabelTargets()
    if ensemble:
        evidence = reflectance_evidence(data, rows, seed)
        source = EnsembleTargets(ensemble, unlabelled, UNLABELLED_BATCH_SIZE, evidence)
    return train(data, rows, steps[0], seed, folder / "state.pt" if folder else None, source)


def reflectance_evidence(data: Dataset, rows: Int, seed: int) -> Float64:
    """(R, 4) log-likelihood of the classes from reflectance, from a classifier trained on `rows`.

    Zero without reflectance, and throughout if some class of `rows` has none.
    """
    known = np.asarray(np.isfinite(data.reflectance).all(axis=1))
    evidence = np.zeros((len(data), N_CLASSES))
    if np.isin(np.arange(N_CLASSES), data.label[rows[known[rows]]]).all():
        features = train_reflectance_classifier.Features(data)
        boxes = train_box_classifier.train(data, rows, train_box_classifier.STEPS, seed)
        layers = train_reflectance_classifier.train(
            data, features, rows, boxes, train_reflectance_classifier.STEPS, seed
        )
        evidence[known] = layer_logits(layers, features.all[known])
    return evidence


@torch.no_grad()
def logits(net: PointNet, data: Dataset, rows: Int) -> Float64:
    """(R, 4) of rows of the data set, without augmentation."""
    rng = np.random.default_rng(0)
    parts = np.split(rows, np.arange(BATCH_SIZE, len(rows), BATCH_SIZE))
    out: Float64 = (
        torch.cat([net(*tensors(subsample(data.take(p), POINTS, rng), data.sensors.take(p))) for p in parts])
        .double()
        .numpy()
    )
    return out


def cross_validate(data: Dataset, k: int, steps: int, teachers: int, seed: int) -> tuple[HeldOut, dict[str, Any]]:
    """Out-of-fold predictions and their scores by sensor."""

    def model(among: Bool, i: int) -> Model:
        net, _ = train_with_teachers(data, among, (steps, steps), teachers, seed + i, None)
        return lambda rows: logits(net, data, rows)

    held = out_of_fold(data, k, model)
    return held, by_sensor(np.log(held.probability), held.validation, held.validation.clear)


def main() -> None:
    parser = training_parser(__doc__, folds=0)
    parser.add_argument("--steps", type=int, default=1600)
    parser.add_argument("--fold-steps", type=int, help="of the networks of folds and teachers (default: --steps)")
    parser.add_argument("--teachers", type=int, default=0, help="number of networks in the ensemble")
    parser.add_argument("--calibrated", type=Path, help="report.json of a run with --folds, for its calibration")
    args = parser.parse_args()
    make_torch_deterministic()
    data = load(*args.crops)
    fold_steps = args.fold_steps or args.steps
    args.out.mkdir(parents=True, exist_ok=True)
    started = time.process_time()
    report: dict[str, Any] = {"seed": args.seed, "steps": args.steps, "teachers": args.teachers}
    report |= {"crops_sha256": data.sha256, "provenance": data.provenance, "torch": torch.__version__}
    calibration = Calibration.identity()
    if args.calibrated:
        earlier = json.loads(args.calibrated.read_text(encoding="utf-8"))
        calibration = Calibration.from_dict(earlier["calibration"])
        report |= {key: earlier[key] for key in ("cross_validation", "class_frequency")}
    elif args.folds:
        held, report["cross_validation"] = cross_validate(data, args.folds, fold_steps, args.teachers, args.seed)
        calibration = held.calibration
        report["class_frequency"] = held.validation.class_frequency.round(4).tolist()
        np.savez(args.out / "held_out.npz", probability=held.probability, crops=data.sha256)
        print(json.dumps(report["cross_validation"]))
    everything = np.ones(len(data), np.bool_)
    net, losses = train_with_teachers(data, everything, (args.steps, fold_steps), args.teachers, args.seed, args.out)
    report |= {"loss": losses, "calibration": calibration.as_dict(), "cpu_s": round(time.process_time() - started)}
    layers = net.layers()
    layers[-1] = calibration.fold_into(layers[-1])
    save_layers(args.out / "weights.npz", layers)
    (args.out / "report.json").write_text(json.dumps(report, indent=1) + "\n", encoding="utf-8")
    print(json.dumps({"loss": losses[-1:], "cpu_s": report["cpu_s"]}))


if __name__ == "__main__":
    main()
