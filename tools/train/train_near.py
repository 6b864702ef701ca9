"""Train the network beside a model that judges what the view of a low sensor cuts (extra [train]).

    python -m tools.train.train_near MODEL.onnx NAME-near.onnx --near NEAR.npz --held NEAR.npz --crops CROPS.npz...
                         --licence TEXT [--steps N] [--seed S]

It begins with the weights of the model, and learns near crops by their labels: those of low sensors, and those
of the streets cut near. A classifier of boxes whose sizes are bounds goes into its metadata. Logits are adjusted for
the shares of the classes in a batch, so posteriors hold for FREQUENCY. The card is scored on --held, on which nothing
is trained.
"""

from __future__ import annotations

import hashlib
import json
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import onnx
import torch
from onnx import helper
from scipy.special import log_softmax, softmax
from torch import nn

from modt.classes import CLASS_NAMES, N_CLASSES, ObjectClass
from modt.classification import box_classifier
from modt.classification.box_classifier import BoxClassifier, Layers, bound_features
from modt.classification.pointnet import CLASS_FREQUENCY_KEY
from modt.classification.pool import log_pool
from modt.types import Bool, Cut, Float64, Int
from modt_training.augment import distance_m, subsample
from modt_training.dataset import Dataset, crop_features, dataset_features, load
from modt_training.export_pointnet import Layer, graph, to_lists
from modt_training.fine_tuning import POINTS, Student, layers_of, tensors
from modt_training.network import Batch, train_mlp
from tools.options import make_torch_deterministic, parser
from tools.train.near_batches import SHARE, NearSource, cut_flags

FREQUENCY = np.array([0.86, 0.03, 0.1, 0.01])
"""Frequency of the classes among proposals near a small robot."""
RATE = 5e-4
"""Greatest learning rate."""
BOUND_CROPS = 60_000
"""Number of crops for the training of the classifier of bounds."""
BOUND_STEPS = 3000
"""Steps of that training."""
SMOOTHING = 0.01
"""Label smoothing: probability spread evenly over the classes."""
EVERY = 100
"""Number of steps over which the printed loss is averaged."""
RANGES_M = ((0.5, 1.0), (1.0, 1.5), (1.5, 3.0), (3.0, 7.0))
"""Rows of the card's table."""


def train(first: list[Layer], source: NearSource, steps: int, seed: int) -> tuple[Student, float]:
    """The network after training from its first layers on, and its loss at the end."""
    torch.manual_seed(seed)
    rng = np.random.default_rng(seed)
    net = Student(first)
    optimiser = torch.optim.AdamW(net.parameters(), weight_decay=1e-3)
    schedule = torch.optim.lr_scheduler.OneCycleLR(optimiser, RATE, total_steps=steps, pct_start=max(0.1, 2 / steps))
    shift = torch.from_numpy(np.log(SHARE / FREQUENCY).astype(np.float32))
    losses: list[float] = []
    for step in range(steps):
        near = source.draw(rng)
        score = net(*tensors(subsample(near.crops, POINTS, rng), near.sensors))
        loss = nn.functional.cross_entropy(score + shift, torch.from_numpy(near.label), label_smoothing=SMOOTHING)
        optimiser.zero_grad()
        loss.backward()
        optimiser.step()
        schedule.step()
        losses = [*losses[1 - EVERY :], loss.item()]
        if (step + 1) % EVERY == 0:
            print(step + 1, round(float(np.mean(losses)), 4), flush=True)
    return net.eval(), round(float(np.mean(losses)), 4)


def train_bounds(source: NearSource, seed: int) -> Layers:
    """The classifier of boxes that are cut, whose posteriors hold for FREQUENCY."""
    torch.manual_seed(seed)
    rng = np.random.default_rng(seed)
    features = []
    labels = []
    n = 0
    while n < BOUND_CROPS:
        near = source.draw(rng)
        found = crop_features(near.crops, near.sensors)
        rows = np.flatnonzero(box_classifier.is_bound(found, near.cut))
        features.append(bound_features(found[rows], near.cut[rows]))
        labels.append(near.label[rows])
        n += len(rows)
    feature = np.concatenate(features)
    label = np.concatenate(labels)

    def batch() -> Batch:
        chosen = rng.integers(0, len(label), 512)
        return feature[chosen], label[chosen], 0.0

    *hidden, (weight, bias) = train_mlp(batch, feature, BOUND_STEPS, rate=1e-2, decay=1e-3)
    share = np.bincount(label, minlength=N_CLASSES).clip(1) / len(label)
    return [*hidden, (weight, bias + np.log(FREQUENCY / share))]


@torch.no_grad()
def network_posterior(network: Student, data: Dataset, rows: Int) -> Float64:
    """(R, C) posteriors of rows of a data set by a network."""
    rng = np.random.default_rng(0)
    parts = [(data.take(part), data.sensors.take(part)) for part in np.array_split(rows, max(1, len(rows) // 500))]
    logits = [network(*tensors(subsample(crops, POINTS, rng), sensors)).double().numpy() for crops, sensors in parts]
    return np.asarray(softmax(np.concatenate(logits), axis=1), np.float64)


def score(probability: Float64, person: Bool) -> str:
    """Recall and precision of people at a posterior of one half [%], of (R, C) and (R,) who is one."""
    called = probability[:, ObjectClass.PEDESTRIAN] > 0.5
    return f"{100 * called[person].mean():.0f} / {100 * person[called].mean() if called.any() else 0:.0f}"


def table(first: Student, net: Student, boxes: BoxClassifier, log_frequency: Float64, held: Dataset) -> list[str]:
    """Markdown of the people found near, by their distance.

    Args:
        first: the network before training.
        net: the network after it.
        boxes: both box classifiers, and the weights of the pool.
        log_frequency: (C,) log of the class frequencies that networks and boxes assume.
        held: crops that nothing was trained on.
    """
    rows = np.flatnonzero(held.trainable)
    cut = cut_flags(held)[rows]
    distance = distance_m(held.crops)[rows]
    person = held.label[rows] == 2
    by_network = network_posterior(net, held, rows)
    by_box = log_softmax(boxes.log_probability(dataset_features(held, rows), cut), axis=1)
    pool = log_pool(by_network, by_box, np.zeros_like(by_box), log_frequency, boxes.weights)
    answers = network_posterior(first, held, rows), by_network, np.exp(by_box), softmax(pool, axis=1)
    lines = ["| distance, cut above or below | people | network before | network | box | pool |", "|" + "---|" * 6]
    for low, high in RANGES_M:
        for word, is_cut in (("cut", True), ("not cut", False)):
            near = (distance > low) & (distance <= high) & ((cut & (Cut.TOP | Cut.BOTTOM) > 0) == is_cut)
            if person[near].any():
                cells = [score(p[near], person[near]) for p in answers]
                lines.append(f"| {low} to {high} m, {word} | {person[near].sum()} | {' | '.join(cells)} |")
    return lines


def main() -> None:
    options = parser(__doc__)
    options.add_argument("model", type=Path)
    options.add_argument("out", type=Path)
    options.add_argument("--near", type=Path, required=True, help="crops of low sensors")
    options.add_argument("--held", type=Path, required=True, help="others, for the card")
    options.add_argument("--crops", type=Path, nargs="+", required=True, help="of the streets")
    options.add_argument("--licence", required=True)
    options.add_argument("--steps", type=int, default=4000, help="of the network (default: %(default)s)")
    options.add_argument("--seed", type=int, default=1)
    args = options.parse_args()
    make_torch_deterministic()
    started = time.process_time()
    model = onnx.load(str(args.model))
    metadata = {entry.key: entry.value for entry in model.metadata_props}
    streets = load(*args.crops)
    near = load(args.near)
    held = load(args.held)
    source = NearSource(near, streets)
    first = layers_of(model)
    bounds = train_bounds(source, args.seed)
    net, loss = train(first, source, args.steps, args.seed)
    network = graph(net.layers())
    helper.set_model_props(network, {box_classifier.BOUNDS_KEY: json.dumps(to_lists(bounds))})
    raw = network.SerializeToString(deterministic=True)
    args.out.write_bytes(raw)

    classifier = box_classifier.from_metadata(metadata)
    assert classifier is not None
    classifier = replace(classifier, bounds=bounds)
    log_frequency = np.log(json.loads(metadata[CLASS_FREQUENCY_KEY]))
    tally = [np.bincount(d.label[d.trainable], minlength=N_CLASSES).tolist() for d in (near, streets)]
    card = [
        f"# {args.out.stem}",
        "",
        f"The network beside {args.model.stem} for what the view of the sensor cuts where a person may go on",
        "(docs/classification.md), ONNX, float32; in its metadata the classifier of such boxes.",
        "",
        f"- sha256: {hashlib.sha256(raw).hexdigest()}",
        f"- licence: {args.licence}",
        f"- training: tools.train.train_near from {args.model.stem} on, seed {args.seed}, {args.steps} steps, torch",
        f"  {torch.__version__}, {time.process_time() - started:.0f} s on one core; loss at the end {loss}",
        f"- crops by class ({', '.join(CLASS_NAMES)}): {tally[0]} simulated near low sensors, sha256",
        f"  {near.sha256[0]};",
        f"  cut near, of those of the streets that show enough: {tally[1]}, sha256",
        f"  {', '.join(streets.sha256)}",
        f"- class frequency near the sensor: {', '.join(f'{100 * f:.0f} %' for f in FREQUENCY)}",
        "",
        f"People of {held.provenance[0]['near']} simulated sweeps that nothing was trained on, a proposal at a time:",
        f"share with a posterior above one half, and precision of these [%]. Before: {args.model.stem}.",
        "",
        *table(Student(first), net, classifier, log_frequency, held),
        "",
    ]
    args.out.with_suffix(".md").write_text("\n".join(card), encoding="utf-8")
    print("\n".join(card))


if __name__ == "__main__":
    main()
