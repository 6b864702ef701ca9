"""Train a model further: heaps and branches are background, people in every posture are people (extra [train]).

    python -m tools.train.train_further MODEL.onnx --bare BARE.npz HELD.npz --people PEOPLE.npz... HELD.npz
                         --streets STREETS.npz... --crops CROPS.npz... [--steps N]

Streets have no heaps, and their people stand and walk. A network that has seen nothing else takes a heap for a car,
and who sits or crouches for background. The network is trained on with four kinds of crops beside one another: those
of --bare are background, those of --people and of --streets have the labels of the simulator, and those of --crops,
the data of the model, keep the posterior that the network gives them. So the class frequencies that the posteriors
assume hold on streets. The box classifier is trained alike, without augmentation: the box of a car
of which a part is cut off is the box of a heap. The model is replaced, and its card gets a section with the false
objects and the people on the held data sets, on which nothing is trained.
"""

from __future__ import annotations

import hashlib
import json
import time
from collections.abc import Iterable, Sequence
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
from modt.classification.box_classifier import BoxClassifier, Layers, Weights
from modt.classification.crops import Crops, canonical
from modt.classification.pointnet import CLASS_FREQUENCY_KEY
from modt.classification.pool import log_pool
from modt.types import Bool, Float64, Int
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

KEPT_BATCHES = 800
"""Batches of crops that keep their posterior, half of them augmented; augmentation costs more than a step."""
BARE_SIZE = 32
"""Number of bare crops of a step, beside BATCH_SIZE crops that keep their posterior."""
BARE_BATCHES = 160
"""Batches of augmented bare crops."""
MIN_WORTH = 0.1
"""Least relative rate at which a bare crop is drawn; the greatest is 1, for what the model takes for an object."""
MIN_BARE_POINTS = 20
"""Least number of points of an augmented bare crop: fewer tell no heap from a part of a car."""
MAX_RANGE_M = 45.0
"""Greatest distance of an augmented bare crop, for the same reason."""
PEOPLE_SIZE = 64
"""Number of crops of people, and of things beside them, of a step: as many of the one as of the other."""
PEOPLE_BATCHES = 250
"""Batches of such crops, half of them augmented."""
PEOPLE_FREQUENCY = np.array([0.89, 0.005, 0.1, 0.005])
"""Frequency of the classes among proposals where people are met in all postures: greater than on streets."""
PEOPLE_BOX_FREQUENCY = np.array([0.94, 0.005, 0.05, 0.005])
"""The same for the box classifier: lower, since a box alone tells less."""
TRAINED_SHARE = 0.82
"""Share of the trained weights in those of the network; the others are those before, which know streets better."""
PEOPLE_SHARE = np.array([0.5, 0.001, 0.5, 0.001])
"""Share of the classes in the crops of people and things."""
MIN_PEOPLE_WORTH = 0.3
"""Least relative rate at which such a crop is drawn; the greatest is 1, for what the model is wrong about."""
MIN_PEOPLE_POINTS = 12
"""Least number of points of such a crop: fewer do not tell a low posture from a thing."""
MIN_PEOPLE_HEIGHT_M = 0.12
"""Least height of such a crop of a person: what one beam sees of who lies is a kerb as well."""
MAX_PEOPLE_M = 18.0
"""Greatest distance of such a crop, for the same reason."""
STREET_SIZE = 96
"""Number of crops of simulated streets of a step, as frequent as they are met."""
RATE = 4e-4
"""Greatest learning rate of the network."""
BOX_CROPS = 40_000
"""Crops of each kind for the box classifier."""
BOX_SIZE = 512
"""Number of crops of a step of the box classifier that keep their posterior."""
BOX_BARE_SIZE = 96
"""Number of bare crops of such a step."""
BOX_PEOPLE_SIZE = 192
"""Number of crops of people and things of such a step."""
BOX_STREET_SIZE = 192
"""Number of crops of simulated streets of such a step."""
MIN_BOX_POINTS = 10
"""Least number of points of bare crops for the box classifier."""
BOX_STEPS = 4
"""Steps of the box classifier for each one of the network; they are cheap."""
BOX_RATE = 6e-3
"""Greatest learning rate of the box classifier."""
MIN_PROBABILITY = 1e-12
"""Floor that keeps logarithms finite."""
CALLED = 0.5
"""Posterior from which a crop counts as called."""
SECTION = "## Trained further"
"""Heading of the section of the card."""


@dataclass(frozen=True)
class Examples:
    """Augmented crops, and the posteriors to learn.

    Attributes:
        local: R crops in the canonical frame.
        wanted: (R, 4) posteriors that the network is to give.
        size: number of them in a step.
        shift: (4,) addend of the logits, by which the share of each class among the crops differs from its frequency.
    """

    local: Crops
    wanted: Float64
    size: int
    shift: Float64

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


def augmented(data: Dataset, drawn: Iterable[Int], rng: Generator) -> tuple[Crops, Float64, Int]:
    """Augmented crops of batches of rows, in the canonical frame; (R,) distance [m] and row of each."""
    parts = []
    distance = []
    drawn_rows = []
    for rows in drawn:
        crops, sensors = augment(subsample(data.take(rows), MAX_POINTS, rng), data.sensors.take(rows), rng)
        parts.append(canonical(subsample(crops, POINTS, rng), sensors.ground_z_m))
        distance.append(distance_m(crops))
        drawn_rows.append(rows)
    return joined(parts), np.concatenate(distance), np.concatenate(drawn_rows)


def unchanged(data: Dataset, drawn: Iterable[Int], rng: Generator) -> tuple[Crops, Int]:
    """Crops of batches of rows without augmentation, in the canonical frame, and (R,) row of each."""
    rows = np.concatenate(list(drawn))
    return canonical(subsample(data.take(rows), POINTS, rng), data.sensors.ground_z_m[rows]), rows


def joined(parts: Sequence[Crops]) -> Crops:
    """Crops of all parts, in order."""
    count = np.concatenate([part.count for part in parts])
    return Crops(np.concatenate([part.xyz for part in parts]), np.append(0, np.cumsum(count)))


def kept_examples(model: Model, data: Dataset, rng: Generator) -> Examples:
    """Crops of the data of the model, each with the posterior that the network gives it, whole objects or not."""
    pools = [sampling_pools(data, rows) for rows in _all_and_simulated(data)]
    drawn = [draw_batch(pool, rng) for pool in pools for _ in range(KEPT_BATCHES // 2)]
    local = joined([augmented(data, drawn[::2], rng)[0], unchanged(data, drawn[1::2], rng)[0]])
    return Examples(local, model.network_posterior(local), BATCH_SIZE, np.zeros(N_CLASSES))


def bare_examples(model: Model, data: Dataset, rng: Generator) -> Examples:
    """Crops without an object, those oftener that the model takes for one."""
    worth = np.maximum(1.0 - model.posterior(data)[:, ObjectClass.BACKGROUND], MIN_WORTH)
    drawn = rng.choice(len(data), (BARE_BATCHES, BATCH_SIZE), p=worth / worth.sum())
    local, distance, _ = augmented(data, drawn, rng)
    rows = np.flatnonzero((distance < MAX_RANGE_M) & (local.count >= MIN_BARE_POINTS))
    background = np.tile(_one_hot(np.array([ObjectClass.BACKGROUND])), (len(rows), 1))
    return Examples(take(local, rows), background, BARE_SIZE, np.zeros(N_CLASSES))


def people_examples(model: Model, data: Dataset, rng: Generator) -> Examples:
    """Crops of people and of things beside them, as many of each, those oftener that the model is wrong about."""
    rows = people_and_things(data)
    label = data.label[rows]
    worth = np.maximum(1.0 - model.posterior(data)[rows, label], MIN_PEOPLE_WORTH)
    is_person = label == ObjectClass.PEDESTRIAN
    worth /= np.where(is_person, worth[is_person].sum(), worth[~is_person].sum())
    drawn = rows[rng.choice(len(rows), (PEOPLE_BATCHES, BATCH_SIZE), p=worth / worth.sum())]
    changed, distance_of_changed, rows_of_changed = augmented(data, drawn[::2], rng)
    same, rows_of_same = unchanged(data, drawn[1::2], rng)
    local = joined([changed, same])
    distance = np.append(distance_of_changed, distance_m(data.take(rows_of_same)))
    label = data.label[np.append(rows_of_changed, rows_of_same)]
    kept = np.flatnonzero(_shows_posture(label, local.count, distance, _height_m(local)))
    wanted = _one_hot(label[kept])
    return Examples(take(local, kept), wanted, PEOPLE_SIZE, np.log(PEOPLE_SHARE / PEOPLE_FREQUENCY))


def _shows_posture(label: Int, count: Int, distance: Float64, height: Float64) -> Bool:
    """(R,) crops that can tell a posture, by (R,) class, points, distance [m] and height [m]."""
    is_flat = (label == ObjectClass.PEDESTRIAN) & (height < MIN_PEOPLE_HEIGHT_M)
    return ~is_flat & (count >= MIN_PEOPLE_POINTS) & (distance < MAX_PEOPLE_M)


def _height_m(crops: Crops) -> Float64:
    """(R,) height of the points of each crop [m]."""
    z = crops.xyz[:, 2]
    starts = crops.offsets[:-1]
    height: Float64 = np.maximum.reduceat(z, starts) - np.minimum.reduceat(z, starts)
    return height


def street_examples(data: Dataset, rng: Generator) -> Examples:
    """Crops of simulated streets, as frequent as they are met."""
    local, rows = unchanged(data, [np.flatnonzero(data.trainable)], rng)
    return Examples(local, _one_hot(data.label[rows]), STREET_SIZE, np.zeros(N_CLASSES))


def people_and_things(data: Dataset) -> Int:
    """Rows of whole people, and of what is clearly no part of one."""
    is_person = data.label == ObjectClass.PEDESTRIAN
    is_thing = (data.label == ObjectClass.BACKGROUND) & ~data.unknown & (data.majority == ObjectClass.BACKGROUND)
    return np.flatnonzero(data.trainable & (is_person | is_thing))


def _one_hot(label: Int) -> Float64:
    """(R, 4) certain posteriors of classes (R,)."""
    return np.eye(N_CLASSES)[label]


def take(crops: Crops, rows: Int) -> Crops:
    """Crops of rows (R,)."""
    offsets = np.append(0, np.cumsum(crops.count[rows]))
    index = np.repeat(crops.offsets[rows] - offsets[:-1], crops.count[rows]) + np.arange(offsets[-1])
    return Crops(crops.xyz[index], offsets)


def train_network(model: Model, kept: Examples, others: Sequence[Examples], steps: int, seed: int) -> Model:
    """The model after training of its network on other crops, and on its own posteriors for those that are kept."""
    torch.manual_seed(seed)
    rng = np.random.default_rng(seed)
    network = Student(model.network.layers())
    optimiser = torch.optim.AdamW(network.parameters(), weight_decay=1e-4)
    schedule = torch.optim.lr_scheduler.OneCycleLR(optimiser, RATE, total_steps=steps, pct_start=max(0.1, 2 / steps))
    parts = (kept, *others)
    for _ in range(steps):
        loss = torch.zeros(())
        for examples in parts:
            rows = rng.integers(0, len(examples.wanted), examples.size)
            target = torch.from_numpy(examples.wanted[rows].astype(np.float32))
            logits = network(*examples.input(rows)) + torch.from_numpy(examples.shift.astype(np.float32))
            loss = loss + nn.functional.cross_entropy(logits, target, reduction="sum")
        optimiser.zero_grad()
        (loss / sum(examples.size for examples in parts)).backward()
        optimiser.step()
        schedule.step()
    both = zip(model.network.layers(), network.layers(), strict=True)
    layers = [
        (_between(weight, new_weight), _between(bias, new_bias)) for (weight, bias), (new_weight, new_bias) in both
    ]
    trained = replace(model, network=Student(layers))
    logits = np.log(trained.network_posterior(kept.local).clip(MIN_PROBABILITY))
    calibration = keep_posteriors(logits, kept.wanted, np.full(len(logits), 1 / len(logits)))
    return replace(model, network=Student(list(calibration.fold_into(layers))))


def _between(before: Weights, after: Weights) -> Weights:
    """Weights between those before and after the training."""
    return (1.0 - TRAINED_SHARE) * before + TRAINED_SHARE * after


@dataclass(frozen=True)
class Boxes:
    """Features of boxes, and the posteriors to learn.

    Attributes:
        feature: (R, 7) features.
        wanted: (R, 4) posteriors that the box classifier is to give.
        size: number of them in a step.
        shift: (4,) addend of the logits, as of Examples.
    """

    feature: Tensor
    wanted: Tensor
    size: int
    shift: Tensor

    @classmethod
    def of(cls, feature: Float64, wanted: Float64, size: int, shift: Float64) -> Boxes:
        """Boxes of arrays."""
        columns = [torch.from_numpy(column.astype(np.float32)) for column in (feature, wanted, shift)]
        return cls(columns[0], columns[1], size, columns[2])


def bare_boxes(bare: Dataset) -> Boxes:
    """Boxes without an object."""
    feature = dataset_features(bare, np.flatnonzero(bare.crops.count >= MIN_BOX_POINTS))
    background = _one_hot(np.full(len(feature), ObjectClass.BACKGROUND))
    return Boxes.of(feature, background, BOX_BARE_SIZE, np.zeros(N_CLASSES))


def people_boxes(people: Dataset, rng: Generator) -> Boxes:
    """Boxes of people and of things beside them, as many of each."""
    rows = people_and_things(people)
    crops = people.take(rows)
    rows = rows[_shows_posture(people.label[rows], crops.count, distance_m(crops), _height_m(crops))]
    is_person = people.label[rows] == ObjectClass.PEDESTRIAN
    drawn = np.concatenate([rng.choice(rows[of_kind], BOX_CROPS) for of_kind in (is_person, ~is_person)])
    wanted = _one_hot(people.label[drawn])
    shift = np.log(PEOPLE_SHARE / PEOPLE_BOX_FREQUENCY)
    return Boxes.of(dataset_features(people, drawn), wanted, BOX_PEOPLE_SIZE, shift)


def street_boxes(streets: Dataset) -> Boxes:
    """Boxes of simulated streets, as frequent as they are met."""
    rows = np.flatnonzero(streets.trainable)
    wanted = _one_hot(streets.label[rows])
    return Boxes.of(dataset_features(streets, rows), wanted, BOX_STREET_SIZE, np.zeros(N_CLASSES))


def train_boxes(model: Model, data: Dataset, others: Sequence[Boxes], steps: int, seed: int) -> Model:
    """The model after training of its box classifier on others, and on its own posteriors for those of `data`."""
    feature = dataset_features(data, np.arange(len(data)))
    wanted = softmax(box_classifier.logits(model.boxes.layers, feature), axis=1)
    pools = [sampling_pools(data, rows) for rows in _all_and_simulated(data)]
    torch.manual_seed(seed)
    rng = np.random.default_rng(seed)
    drawn = np.concatenate([draw_batch(pool, rng, BOX_CROPS) for pool in pools])
    kept = Boxes.of(feature[drawn], wanted[drawn], BOX_SIZE, np.zeros(N_CLASSES))
    parts = (kept, *others)
    net = BoxStudent(model.boxes.layers)
    optimiser = torch.optim.AdamW(net.parameters(), weight_decay=1e-4)
    schedule = torch.optim.lr_scheduler.OneCycleLR(optimiser, BOX_RATE, total_steps=steps, pct_start=0.1)
    for _ in range(steps):
        loss = torch.zeros(())
        for boxes in parts:
            rows = torch.from_numpy(rng.integers(0, len(boxes.feature), boxes.size))
            logits = net(boxes.feature[rows]) + boxes.shift
            loss = loss + nn.functional.cross_entropy(logits, boxes.wanted[rows], reduction="sum")
        optimiser.zero_grad()
        (loss / sum(boxes.size for boxes in parts)).backward()
        optimiser.step()
        schedule.step()
    weight = np.zeros(len(data))
    for rows_of_class, share in (pair for pool in pools for pair in pool):
        weight[rows_of_class] += 1 / len(rows_of_class) if share is None else share
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


def false_objects(before: Model, after: Model, held: Dataset) -> list[str]:
    """Markdown of the false objects a sweep without any, by sensor."""
    posteriors = [model.posterior(held) for model in (before, after)]
    lines = [f"| sensor | sweeps | proposals | {' | '.join(CLASS_NAMES[1:])} |", "|---|---|---|---|---|---|"]
    for number, name in enumerate(held.sensor_names):
        rows = held.sensor == number
        sweeps = max(len(np.unique(held.drive[rows])), 1)
        cells = []
        for c in range(1, N_CLASSES):
            false = [(p[rows, c] > CALLED).sum() / sweeps for p in posteriors]
            cells.append(" / ".join(f"{f:.2f}" for f in false))
        lines.append(f"| {name} | {sweeps} | {rows.sum()} | {' | '.join(cells)} |")
    return lines


def people_called(before: Model, after: Model, held: Dataset) -> list[str]:
    """Markdown of the people called and the things called pedestrian among people in all postures, by sensor."""
    posteriors = [model.posterior(held)[:, ObjectClass.PEDESTRIAN] for model in (before, after)]
    clear = np.zeros(len(held), np.bool_)
    clear[people_and_things(held)] = True
    is_person = held.label == ObjectClass.PEDESTRIAN
    lines = ["| sensor | people | called [%] | things | called pedestrian [%] |", "|---|---|---|---|---|"]
    for number, name in enumerate(held.sensor_names):
        cells = []
        for rows in (clear & is_person, clear & ~is_person):
            of_sensor = rows & (held.sensor == number)
            shares = [100 * (p[of_sensor] > CALLED).mean() if of_sensor.any() else 0.0 for p in posteriors]
            cells += [str(of_sensor.sum()), " / ".join(f"{share:.1f}" for share in shares)]
        lines.append(f"| {name} | {' | '.join(cells)} |")
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


def section(before: Model, after: Model, held_people: Dataset, held_bare: Dataset, facts: Sequence[str]) -> str:
    """Section of the card: how the model was trained, what it calls of held sweeps, and what it takes for objects."""
    people_sweeps = held_people.provenance[0]["people"]
    bare_sweeps = held_bare.provenance[0]["bare"]
    lines = [
        SECTION,
        "",
        "With simulated sweeps (tools.train.train_further): before / after. The tables above are those before.",
        "A pedestrian is any person who does not ride a two-wheeler, in every posture, with all that they carry,",
        "wear or sit in.",
        "",
        *facts,
        "",
        "People who stand, bend, sit, kneel, crouch and lie, children and adults, with loads and aids, and things",
        f"beside them, in {people_sweeps} sweeps that nothing was trained on: share with a posterior above {CALLED}.",
        "",
        *people_called(before, after, held_people),
        "",
        "False objects a sweep among heaps, banks, boulders, rubble, stacks, bushes and young trees, in",
        f"{bare_sweeps} sweeps that nothing was trained on: proposals with an object posterior above {CALLED}.",
        "",
        *false_objects(before, after, held_bare),
        "",
    ]
    return "\n".join(lines)


def _sources(name: str, data: Dataset) -> str:
    """How many crops a data set has, and from which files."""
    return f"{len(data)} {name}, sha256 {', '.join(data.sha256)}"


def main() -> None:
    options = parser(__doc__)
    options.add_argument("model", type=Path)
    options.add_argument("--bare", type=Path, nargs=2, required=True, help="sweeps without objects; others, held out")
    options.add_argument(
        "--people", type=Path, nargs="+", required=True, help="sweeps of people; the last ones held out"
    )
    options.add_argument("--streets", type=Path, nargs="+", required=True, help="sweeps of simulated streets")
    options.add_argument("--crops", type=Path, nargs="+", required=True, help="data of the model")
    options.add_argument("--steps", type=int, default=1500, help="of the training (default: %(default)s)")
    args = options.parse_args()
    make_torch_deterministic()
    started = time.process_time()
    proto = onnx.load(str(args.model))
    before = Model.of(proto)
    data = load(*args.crops)
    bare, held_bare = (load(path) for path in args.bare)
    people = load(*args.people[:-1])
    held_people = load(args.people[-1])
    streets = load(*args.streets)
    rng = np.random.default_rng(SEED)
    kept = kept_examples(before, data, rng)
    others = bare_examples(before, bare, rng), people_examples(before, people, rng), street_examples(streets, rng)
    after = train_network(before, kept, others, args.steps, SEED)
    boxes = bare_boxes(bare), people_boxes(people, rng), street_boxes(streets)
    after = train_boxes(after, data, boxes, BOX_STEPS * args.steps, SEED)
    first_sha256 = hashlib.sha256(args.model.read_bytes()).hexdigest()
    sha256 = save(args.model, proto, after)
    seconds = time.process_time() - started
    crops = [
        _sources("of sweeps without objects", bare),
        _sources("of sweeps of people", people),
        _sources("of streets", streets),
        _sources("of the data of the model, which keep their posteriors", data),
    ]
    facts = [
        f"- trained from the model of sha256 {first_sha256} on, seed {SEED}, {args.steps} steps, "
        f"torch {torch.__version__}, {seconds:.0f} s on one core",
        f"- crops: {'; '.join(crops)}",
    ]
    told = section(before, after, held_people, held_bare, facts)
    card = args.model.with_suffix(".md")
    text = card.read_text(encoding="utf-8").partition(SECTION)[0].replace(first_sha256, sha256, 1)
    card.write_text(f"{text.rstrip()}\n\n{told}", encoding="utf-8")
    print(told)


if __name__ == "__main__":
    main()
