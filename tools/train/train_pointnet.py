"""Train the PointNet on a data set of crops; seeded and resumable (extra [train]).

    python -m tools.train.train_pointnet OUT_DIR CROPS.npz... [--epochs N] [--folds K] [--teachers T] [--seed S]

Writes OUT_DIR/weights.npz for export_pointnet and OUT_DIR/report.json: loss curve, and with --folds the
out-of-fold average precision, confusion and calibration (drives are never split between folds), and the probabilities
themselves, OUT_DIR/held_out.npz, for train_reflectance. The temperature and
class offsets that make the confidences mean what they say are fitted out of fold and folded into the last layer.
With --teachers as many networks are trained first, as long as those of the folds, and teach the one that is written;
of crops without a label, what their returns add (tools/train/train_reflectance.py) does so as well.
An epoch is as many draws as there are clear crops of real scans (of any, without real ones); the paper's settings are
40 epochs (weak) and 100 (converged).
"""

from __future__ import annotations

import argparse
import json
import time
from pathlib import Path
from typing import Any

import numpy as np
import torch

from modt.classes import CLASS_NAMES, N_CLASSES
from modt.classification.crops import Crops, canonical
from modt.classification.mlp import logits as layer_logits
from modt.evaluation.class_score import average_precision, confusion, top_calibration_error
from modt.types import Bool, Float64, Int
from tools.train import train_boxes, train_reflectance
from tools.train.augment import Beams, augment, limit
from tools.train.batches import BATCH, draw, odds
from tools.train.dataset import SENSOR_HEIGHT_M, UNLABELLED, Dataset, load
from tools.train.held_out import HeldOut, Model, cross_validated
from tools.train.network import PointNet
from tools.train.teaching import Ensemble, Labels, Teaching
from tools.train.temperature import Calibration
from tools.train.weights import save_layers

POINTS, MOST_POINTS = 128, 400
"""Points of each crop, and points that are augmented at most."""
FURTHER = 102
"""Crops of a step besides that nobody labelled, where there are teachers."""


def tensors(crops: Crops) -> tuple[torch.Tensor, torch.Tensor]:
    """Canonical crops for the network."""
    seen = canonical(crops, SENSOR_HEIGHT_M)
    return torch.from_numpy(seen.xyz), torch.from_numpy(seen.count)


def train(
    data: Dataset, rows: Int, steps: int, seed: int, state: Path | None, teaching: Teaching
) -> tuple[PointNet, list[float]]:
    """A network trained on these rows, and its loss every 50 steps; taken up again where state was left."""
    torch.manual_seed(seed)
    rng = np.random.default_rng(seed)
    net = PointNet()
    optimiser = torch.optim.AdamW(net.parameters(), weight_decay=0.02)
    schedule = torch.optim.lr_scheduler.OneCycleLR(optimiser, 3e-3, total_steps=steps, pct_start=0.15)
    criterion = torch.nn.CrossEntropyLoss()
    pools = odds(data, rows)
    losses: list[float] = []
    first = 0
    if state is not None and state.exists():
        held = torch.load(state, weights_only=False)
        net.load_state_dict(held["net"])
        optimiser.load_state_dict(held["optimiser"])
        schedule.load_state_dict(held["schedule"])
        torch.set_rng_state(held["torch"])
        rng.bit_generator.state = held["numpy"]
        losses, first = held["losses"], held["step"]
    running = 0.0
    for step in range(first, steps):
        chosen = draw(pools, rng)
        further = teaching.further(rng)
        shown = data.take(np.append(chosen, further))
        seen = tensors(limit(augment(limit(shown, MOST_POINTS, rng), Beams(), rng), POINTS, rng))
        loss = criterion(net(*seen), teaching.targets(*seen, data.label[chosen], further))
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
            held = {"net": net.state_dict(), "optimiser": optimiser.state_dict(), "schedule": schedule.state_dict()}
            held |= {"torch": torch.get_rng_state(), "numpy": rng.bit_generator.state}
            torch.save(held | {"losses": losses, "step": step + 1}, state)
    return net.eval(), losses


def educate(
    data: Dataset, among: Bool, steps: tuple[int, int], teachers: int, seed: int, folder: Path | None
) -> tuple[PointNet, list[float]]:
    """A network trained on what is labelled among these.

    It is taught by as many networks and, of crops without a label, by what their returns add; these learnt from the
    same.

    Args:
        data: all crops.
        among: (R,) those that may be seen.
        steps: of the network, and of each teacher.
        teachers: how many; without any the network goes by the labels.
        seed: of the network; the teachers' follow from it.
        folder: where states are kept.
    """
    rows = np.flatnonzero(among & data.clear)
    states = [folder / f"teacher{t}.pt" if folder else None for t in range(teachers)]
    taught = [train(data, rows, steps[1], seed + 100 * t, s, Labels())[0] for t, s in enumerate(states, start=1)]
    unlabelled = np.flatnonzero(among & (data.variant == UNLABELLED))
    teaching = Ensemble(taught, unlabelled, FURTHER, evidence_of_returns(data, rows, seed)) if taught else Labels()
    return train(data, rows, steps[0], seed, folder / "state.pt" if folder else None, teaching)


def evidence_of_returns(data: Dataset, rows: Int, seed: int) -> Float64:
    """(R, 4) what the returns of each crop add to the logarithms of its classes; 0 if unknown.

    Nor is it known where these rows show a class without returns.
    """
    evidence, known = np.zeros((len(data), N_CLASSES)), np.isfinite(data.reflectance).all(axis=1)
    if np.isin(np.arange(N_CLASSES), data.label[rows[known[rows]]]).all():
        seen = train_reflectance.Described(data)
        boxes = train_boxes.train(data, rows, train_boxes.STEPS, seed)
        layers = train_reflectance.train(data, seen, rows, boxes, train_reflectance.STEPS, seed)
        evidence[known] = layer_logits(layers, seen.whole[known])
    return evidence


@torch.no_grad()
def logits(net: PointNet, data: Dataset, rows: Int) -> Float64:
    """(R, 4) of these rows, as they are."""
    rng = np.random.default_rng(0)
    parts = [net(*tensors(limit(data.take(rows[i : i + BATCH]), POINTS, rng))) for i in range(0, len(rows), BATCH)]
    return torch.cat(parts).double().numpy()


def cross_validate(data: Dataset, k: int, steps: int, teachers: int, seed: int) -> tuple[HeldOut, dict[str, Any]]:
    """What is said out of fold, and its scores; missed objects count as false negatives."""

    def trained(among: Bool, i: int) -> Model:
        net, _ = educate(data, among, (steps, steps), teachers, seed + i, None)
        return lambda rows: logits(net, data, rows)

    held = cross_validated(data, k, trained)
    probability, clear = held.probability, held.clear
    label = held.label[clear]
    return held, {
        "average_precision": average_precision(probability, held.label, held.truth),
        "objects": {name: int(n) for name, n in zip(CLASS_NAMES[1:], held.truth[1:], strict=True)},
        "confusion": confusion(probability[clear], label),
        "ece": round(top_calibration_error(probability[clear], label) or 0.0, 4),
        "ece_uncalibrated": round(
            top_calibration_error(Calibration.none().apply(held.logits[clear]), label) or 0.0, 4
        ),
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("out", type=Path)
    parser.add_argument("crops", type=Path, nargs="+")
    parser.add_argument("--epochs", type=float, default=40)
    parser.add_argument("--fold-epochs", type=float, help="of each fold's network; as many as --epochs without it")
    parser.add_argument("--folds", type=int, default=0, help="cross-validate first; 0: leave that out")
    parser.add_argument("--teachers", type=int, default=0, help="networks that teach the one that is written")
    parser.add_argument("--judged", type=Path, help="report.json of a cross-validated run whose calibration to take")
    parser.add_argument("--seed", type=int, default=1)
    args = parser.parse_args()
    torch.set_num_threads(1)
    torch.use_deterministic_algorithms(True)
    data = load(*args.crops)
    args.out.mkdir(parents=True, exist_ok=True)
    clear = np.flatnonzero(data.clear)
    per_epoch = np.count_nonzero(data.variant[clear] == data.variant[clear].min()) / BATCH
    started = time.process_time()
    report: dict[str, Any] = {"seed": args.seed, "epochs": args.epochs, "teachers": args.teachers}
    report |= {"crops_sha256": data.sha256, "provenance": data.provenance, "torch": torch.__version__}
    calibration = Calibration.none()
    if args.judged:
        earlier = json.loads(args.judged.read_text(encoding="utf-8"))
        calibration = Calibration.of_dict(earlier["calibration"])
        report["cross_validation"] = earlier["cross_validation"]
    elif args.folds:
        steps = round(per_epoch * (args.fold_epochs or args.epochs) * (1 - 1 / args.folds))
        held, report["cross_validation"] = cross_validate(data, args.folds, steps, args.teachers, args.seed)
        calibration = held.calibration
        np.savez(args.out / "held_out.npz", probability=held.probability, crops=data.sha256)
        print(json.dumps(report["cross_validation"]))
    everything = np.ones(len(data), np.bool_)
    both = round(per_epoch * args.epochs), round(per_epoch * (args.fold_epochs or args.epochs))
    net, losses = educate(data, everything, both, args.teachers, args.seed, args.out)
    report |= {"loss": losses, "calibration": calibration.as_dict(), "cpu_s": round(time.process_time() - started)}
    layers = net.layers()
    layers[-1] = calibration.folded(layers[-1])
    save_layers(args.out / "weights.npz", layers)
    (args.out / "report.json").write_text(json.dumps(report, indent=1) + "\n", encoding="utf-8")
    print(json.dumps({"loss": losses[-1:], "cpu_s": report["cpu_s"]}))


if __name__ == "__main__":
    main()
