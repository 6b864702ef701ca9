"""Train a model further, so that heaps, banks, boulders and branches are background (extra [train]).

    python -m tools.train.train_bare MODEL.onnx --bare BARE.npz --held BARE.npz --crops CROPS.npz... [--steps N]

Streets have no heaps, and a network that has never seen one takes it for a car. The network is trained on: crops of
--bare are background, and those of --crops, the data of the model, keep the posterior that the network gives them.
So nothing is learnt about streets, and the class frequencies that the posteriors assume hold on them. The box
classifier is trained alike, without augmentation: the box of a car of which a part is cut off is the box of a heap.
The model is replaced, and its card gets a section with the false objects on --held, on which nothing is trained.
"""

from __future__ import annotations

import hashlib
import json
import time
from collections.abc import Iterable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import onnx
import torch
from numpy.random import Generator
from onnx import helper
from scipy.optimize import minimize
from scipy.special import log_softmax, softmax
from torch import Tensor, nn

from modt.classes import CLASS_NAMES, N_CLASSES, ObjectClass
from modt.classification import box_classifier
from modt.classification.box_classifier import BoxClassifier, Layers
from modt.classification.crops import Crops, canonical
from modt.classification.pointnet import CLASS_FREQUENCY_KEY
from modt.classification.pool import log_pool
from modt.types import Float64, Int
from tools.options import make_torch_deterministic, parser
from tools.train.augment import augment, subsample
from tools.train.dataset import (
    BATCH_SIZE,
    SEED,
    SYNTHETIC,
    Dataset,
    crop_features,
    dataset_features,
    draw_batch,
    load,
    sampling_pools,
)
from tools.train.export_pointnet import classifier_entry, graph
from tools.train.held_out import Calibration
from tools.train.near_batches import distance_m
from tools.train.train_near import Student, layers_of
from tools.train.train_pointnet import MAX_POINTS, POINTS

KEPT_BATCHES = 400
"""Batches of augmented crops that keep their posterior; augmentation costs more than a step."""
BARE_SIZE = 48
"""Number of bare crops of a step, beside BATCH_SIZE crops that keep their posterior."""
BARE_BATCHES = 160
"""Batches of augmented bare crops."""
MIN_WORTH = 0.1
"""Least relative rate at which a bare crop is drawn; the greatest is 1, for what the model takes for an object."""
MIN_BARE_POINTS = 20
"""Least number of points of an augmented bare crop: fewer tell no heap from a part of a car."""
MAX_RANGE_M = 45.0
"""Greatest distance of an augmented bare crop, for the same reason."""
RATE = 5e-4
"""Greatest learning rate of the network."""
BOX_CROPS = 40_000
"""Crops of each kind for the box classifier."""
BOX_SIZE = 512
"""Number of crops of a step of the box classifier that keep their posterior."""
BOX_BARE_SIZE = 128
"""Number of bare crops of such a step."""
MIN_BOX_POINTS = 10
"""Least number of points of these."""
BOX_STEPS = 4
"""Steps of the box classifier for each one of the network; they are cheap."""
BOX_RATE = 6e-3
"""Greatest learning rate of the box classifier."""
MIN_PROBABILITY = 1e-12
"""Floor that keeps logarithms finite."""
CALLED = 0.5
"""Object posterior from which a bare crop is a false object."""
SECTION = "## Without objects"
"""Heading of the section of the card."""


@dataclass(frozen=True)
class Examples:
    """Augmented crops, and the posteriors to learn.

    Attributes:
        local: R crops in the canonical frame.
        wanted: (R, 4) posteriors that the network is to give.
    """

    local: Crops
    wanted: Float64

    def input(self, rows: Int) -> tuple[Tensor, Tensor]:
        """Input of the network: (K, 3) points, crop after crop, and (R,) points of each crop."""
        crops = take(self.local, rows)
        return torch.from_numpy(crops.xyz), torch.from_numpy(crops.count)


class BoxStudent(nn.Module):
    """The box classifier, from its calibrated layers on."""

    def __init__(self, layers: Layers) -> None:
        super().__init__()
        self.weight = nn.ParameterList(torch.from_numpy(np.array(w, np.float32)) for w, _ in layers)
        self.bias = nn.ParameterList(torch.from_numpy(np.array(b, np.float32)) for _, b in layers)

    def forward(self, feature: Tensor) -> Tensor:
        """(R, 4) logits of (R, 7) features."""
        value = feature
        for i, (weight, bias) in enumerate(zip(self.weight, self.bias, strict=True)):
            value = value @ weight + bias
            value = torch.tanh(value) if i < len(self.weight) - 1 else value
        return value

    def layers(self) -> Layers:
        """(in, out) weight and (out,) bias of each layer."""
        return [(w.detach().numpy(), b.detach().numpy()) for w, b in zip(self.weight, self.bias, strict=True)]


@dataclass(frozen=True)
class Model:
    """What decides the posterior of a proposal of which the reflectance is not known.

    Attributes:
        network: the network.
        boxes: the box classifier.
        log_frequency: (4,) log of the class frequencies that both assume.
    """

    network: Student
    boxes: BoxClassifier
    log_frequency: Float64

    @classmethod
    def of(cls, model: onnx.ModelProto) -> Model:
        """Read the parts of an exported model."""
        metadata = {entry.key: entry.value for entry in model.metadata_props}
        boxes = box_classifier.from_metadata(metadata)
        assert boxes is not None
        return cls(Student(layers_of(model)), boxes, np.log(json.loads(metadata[CLASS_FREQUENCY_KEY])))

    @torch.no_grad()
    def network_posterior(self, local: Crops) -> Float64:
        """(R, 4) posteriors by the network, of R crops in the canonical frame."""
        logits = []
        for first in range(0, len(local), 500):
            part = slice(first, min(first + 500, len(local)))
            xyz = local.xyz[local.offsets[part.start] : local.offsets[part.stop]]
            logits.append(self.network(torch.from_numpy(xyz), torch.from_numpy(local.count[part])).double().numpy())
        return np.asarray(softmax(np.concatenate(logits), axis=1), np.float64)

    def posterior(self, data: Dataset) -> Float64:
        """(R, 4) posteriors by network and box together, of the crops of a data set, without augmentation."""
        local = canonical(subsample(data.crops, POINTS, np.random.default_rng(0)), data.sensors.ground_z_m)
        log_box = box_classifier.logits(self.boxes.layers, crop_features(data.crops, data.sensors))
        none = np.zeros_like(log_box)
        pool = log_pool(self.network_posterior(local), log_box, none, self.log_frequency, self.boxes.weights)
        return np.asarray(softmax(pool, axis=1), np.float64)


def augmented(data: Dataset, drawn: Iterable[Int], rng: Generator) -> tuple[Crops, Float64]:
    """Augmented crops of batches of rows, in the canonical frame, and (R,) distance of each [m]."""
    xyz = []
    count = []
    distance = []
    for rows in drawn:
        crops, sensors = augment(subsample(data.take(rows), MAX_POINTS, rng), data.sensors.take(rows), rng)
        local = canonical(subsample(crops, POINTS, rng), sensors.ground_z_m)
        xyz.append(local.xyz)
        count.append(local.count)
        distance.append(distance_m(crops))
    return Crops(np.concatenate(xyz), np.append(0, np.cumsum(np.concatenate(count)))), np.concatenate(distance)


def kept_examples(model: Model, data: Dataset, rng: Generator) -> Examples:
    """Crops of the data of the model, each with the posterior that the network gives it, whole objects or not."""
    pools = [sampling_pools(data, rows) for rows in _all_and_simulated(data)]
    drawn = [draw_batch(pool, rng) for pool in pools for _ in range(KEPT_BATCHES // 2)]
    local, _ = augmented(data, drawn, rng)
    return Examples(local, model.network_posterior(local))


def bare_examples(model: Model, data: Dataset, rng: Generator) -> Examples:
    """Crops without an object, those oftener that the model takes for one."""
    worth = np.maximum(1.0 - model.posterior(data)[:, ObjectClass.BACKGROUND], MIN_WORTH)
    drawn = rng.choice(len(data), (BARE_BATCHES, BATCH_SIZE), p=worth / worth.sum())
    local, distance = augmented(data, drawn, rng)
    rows = np.flatnonzero((distance < MAX_RANGE_M) & (local.count >= MIN_BARE_POINTS))
    background = np.tile(np.eye(N_CLASSES)[ObjectClass.BACKGROUND], (len(rows), 1))
    return Examples(take(local, rows), background)


def take(crops: Crops, rows: Int) -> Crops:
    """Crops of rows (R,)."""
    offsets = np.append(0, np.cumsum(crops.count[rows]))
    index = np.repeat(crops.offsets[rows] - offsets[:-1], crops.count[rows]) + np.arange(offsets[-1])
    return Crops(crops.xyz[index], offsets)


def train_network(model: Model, kept: Examples, bare: Examples, steps: int, seed: int) -> Model:
    """The model after training of its network on bare crops, and on its own posteriors for the others."""
    torch.manual_seed(seed)
    rng = np.random.default_rng(seed)
    network = Student(model.network.layers())
    optimiser = torch.optim.AdamW(network.parameters(), weight_decay=1e-4)
    schedule = torch.optim.lr_scheduler.OneCycleLR(optimiser, RATE, total_steps=steps, pct_start=max(0.1, 2 / steps))
    for _ in range(steps):
        loss = torch.zeros(())
        for examples, size in ((kept, BATCH_SIZE), (bare, BARE_SIZE)):
            rows = rng.integers(0, len(examples.wanted), size)
            target = torch.from_numpy(examples.wanted[rows].astype(np.float32))
            loss = loss + nn.functional.cross_entropy(network(*examples.input(rows)), target, reduction="sum")
        optimiser.zero_grad()
        (loss / (BATCH_SIZE + BARE_SIZE)).backward()
        optimiser.step()
        schedule.step()
    trained = replace(model, network=network.eval())
    logits = np.log(trained.network_posterior(kept.local).clip(MIN_PROBABILITY))
    calibration = keep_posteriors(logits, kept.wanted, np.full(len(logits), 1 / len(logits)))
    return replace(model, network=Student(list(calibration.fold_into(network.layers()))))


def train_boxes(model: Model, data: Dataset, bare: Dataset, steps: int, seed: int) -> Model:
    """The model after training of its box classifier on bare crops, and on its own posteriors for the others."""
    feature = dataset_features(data, np.arange(len(data)))
    wanted = softmax(box_classifier.logits(model.boxes.layers, feature), axis=1)
    pools = [sampling_pools(data, rows) for rows in _all_and_simulated(data)]
    background = dataset_features(bare, np.flatnonzero(bare.crops.count >= MIN_BOX_POINTS))
    torch.manual_seed(seed)
    rng = np.random.default_rng(seed)
    drawn = np.concatenate([draw_batch(pool, rng, BOX_CROPS) for pool in pools])
    kept = torch.from_numpy(feature[drawn].astype(np.float32))
    target = torch.from_numpy(wanted[drawn].astype(np.float32))
    nothing = torch.from_numpy(background.astype(np.float32))
    is_nothing = torch.eye(N_CLASSES)[ObjectClass.BACKGROUND].expand(BOX_BARE_SIZE, N_CLASSES)
    net = BoxStudent(model.boxes.layers)
    optimiser = torch.optim.AdamW(net.parameters(), weight_decay=1e-4)
    schedule = torch.optim.lr_scheduler.OneCycleLR(optimiser, BOX_RATE, total_steps=steps, pct_start=0.1)
    for _ in range(steps):
        some = torch.from_numpy(rng.integers(0, len(kept), BOX_SIZE))
        bares = torch.from_numpy(rng.integers(0, len(nothing), BOX_BARE_SIZE))
        loss = nn.functional.cross_entropy(net(kept[some]), target[some], reduction="sum")
        loss = loss + nn.functional.cross_entropy(net(nothing[bares]), is_nothing, reduction="sum")
        optimiser.zero_grad()
        (loss / (BOX_SIZE + BOX_BARE_SIZE)).backward()
        optimiser.step()
        schedule.step()
    weight = np.zeros(len(data))
    for rows, share in (pair for pool in pools for pair in pool):
        weight[rows] += 1 / len(rows) if share is None else share
    layers = net.layers()
    calibration = keep_posteriors(box_classifier.logits(layers, feature), wanted, weight / weight.sum())
    return replace(model, boxes=replace(model.boxes, layers=calibration.fold_into(layers)))


def _all_and_simulated(data: Dataset) -> tuple[Int, Int]:
    """All rows of a data set, and those of simulated sweeps.

    Bare crops are all simulated: without as many simulated objects beside them, simulated would mean background.
    """
    return np.arange(len(data)), np.flatnonzero(data.variant == SYNTHETIC)


def keep_posteriors(logits: Float64, wanted: Float64, weight: Float64) -> Calibration:
    """Calibration of (R, 4) logits to posteriors (R, 4), crops weighted by (R,), 1 in total."""

    def loss(theta: Float64) -> float:
        log_posterior = log_softmax(logits * np.exp(-theta[0]) + np.append(0.0, theta[1:]), axis=1)
        return -float(weight @ (wanted * log_posterior).sum(axis=1))

    found = minimize(loss, np.zeros(N_CLASSES), method="L-BFGS-B").x
    return Calibration(float(np.exp(found[0])), np.append(0.0, found[1:]))


def table(before: Model, after: Model, held: Dataset) -> list[str]:
    """Markdown of the false objects in sweeps without any, by sensor."""
    posteriors = [model.posterior(held) for model in (before, after)]
    sweeps = np.array([len(np.unique(held.drive[held.sensor == s])) for s in range(len(held.sensor_names))])
    lines = [f"| sensor | sweeps | proposals | {' | '.join(CLASS_NAMES[1:])} |", "|---|---|---|---|---|---|"]
    for number, name in enumerate(held.sensor_names):
        rows = held.sensor == number
        cells = []
        for c in range(1, N_CLASSES):
            false = [(p[rows, c] > CALLED).sum() / max(sweeps[number], 1) for p in posteriors]
            cells.append(" / ".join(f"{f:.2f}" for f in false))
        lines.append(f"| {name} | {sweeps[number]} | {rows.sum()} | {' | '.join(cells)} |")
    return lines


def save(path: Path, model: onnx.ModelProto, trained: Model) -> str:
    """Write the model with its new network and box classifier; returns its SHA-256."""
    network = graph(trained.network.layers())
    boxes = classifier_entry(trained.boxes.layers, trained.boxes.weights)
    metadata = {entry.key: entry.value for entry in model.metadata_props}
    helper.set_model_props(network, metadata | {box_classifier.METADATA_KEY: json.dumps(boxes)})
    raw = network.SerializeToString(deterministic=True)
    path.write_bytes(raw)
    return hashlib.sha256(raw).hexdigest()


def main() -> None:
    options = parser(__doc__)
    options.add_argument("model", type=Path)
    options.add_argument("--bare", type=Path, required=True, help="crops of sweeps without objects")
    options.add_argument("--held", type=Path, required=True, help="others, for the card")
    options.add_argument("--crops", type=Path, nargs="+", required=True, help="data of the model")
    options.add_argument("--steps", type=int, default=3000, help="of the training (default: %(default)s)")
    args = options.parse_args()
    make_torch_deterministic()
    started = time.process_time()
    proto = onnx.load(str(args.model))
    before = Model.of(proto)
    data = load(*args.crops)
    bare = load(args.bare)
    held = load(args.held)
    rng = np.random.default_rng(SEED)
    kept = kept_examples(before, data, rng)
    after = train_network(before, kept, bare_examples(before, bare, rng), args.steps, SEED)
    after = train_boxes(after, data, bare, BOX_STEPS * args.steps, SEED)
    first_sha256 = hashlib.sha256(args.model.read_bytes()).hexdigest()
    sha256 = save(args.model, proto, after)
    section = [
        SECTION,
        "",
        "False objects a sweep among heaps, banks, boulders, rubble, stacks, bushes and young trees, before / after",
        f"further training (tools.train.train_bare): proposals with an object posterior above {CALLED} in",
        f"{held.provenance[0]['bare']} simulated sweeps that nothing was trained on. The tables above are those "
        "before.",
        "",
        f"- trained from the model of sha256 {first_sha256} on, seed {SEED}, {args.steps} steps, torch "
        f"{torch.__version__}, {time.process_time() - started:.0f} s on one core",
        f"- crops: {len(bare)} of {bare.provenance[0]['bare']} sweeps without objects, sha256 {bare.sha256[0]}; "
        f"{len(data)} of the data of the model, which keep their posteriors, sha256 {', '.join(data.sha256)}",
        "",
        *table(before, after, held),
        "",
    ]
    card = args.model.with_suffix(".md")
    text = card.read_text(encoding="utf-8").partition(SECTION)[0].replace(first_sha256, sha256, 1)
    card.write_text(text.rstrip() + "\n\n" + "\n".join(section), encoding="utf-8")
    print("\n".join(section))


if __name__ == "__main__":
    main()
